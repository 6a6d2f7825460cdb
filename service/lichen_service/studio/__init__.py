"""The studio: the page at `/`, on which operations are tried and what accuracy costs is seen.

`page/` holds what a browser reads: HTML, style sheets, ECMAScript modules and samples, served as they lie there. No
step builds them and none comes from elsewhere. They know the service as any client does, by its API.

What only a page needs is made here: pictures of the catalogue (`thumbnails`), the hard cases seen and run (`cases`),
and what each operation is first shown with (`samples`). All of it is derived from declarations. Each of these is a
fixed set, made once and kept, so that it can be given to whoever opens the page without a key.
"""
