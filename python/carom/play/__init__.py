"""`carom play`: billiards in the browser, each shot computed by method `events`.

`game.py` has the table and its shots, `server.py` the server on this machine, `assets` the page around the viewer's own.
"""
