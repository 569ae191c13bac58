"""The scenario format: its tables (`model`, `options`), reading (`load`), writing (`dump`), checking
(`checks`, `advice`).

`carom.Scene` is the public face of this package.
"""
