"""Work in the background: a queue on disk that outlives the process, and the threads that work it off."""
