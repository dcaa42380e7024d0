"""One module a verb: what a request asks for is done, on files and on values."""
