"""Many images by one command: a manifest of items, each done once, whatever happens in between.

    manifest   lines of JSON or CSV, or a pattern of files -> items, all of them checked before the first one starts
    checking   whether a line can be done at all, found without reading a pixel
    places     files and objects by path or URL, read whole and written whole or not at all
    work       one item: read, ask a service (or the same engine here), write
    hands      processes that do items one at a time, within a time and a memory of their own
    engines    who does the items: hands here, a service, or a cluster
    cluster    the same hands on the workers of a Dask cluster
    journal    what became of each item, a line each; what a resumed run is told by
    run        the loop that keeps hands busy
    summary    the account at its end

And one image that is larger than memory: `tiles` computes it part by part, `rasters` reads and writes it so.
"""
