"""Films and pictures of a run, drawn off-screen: `carom export RUN --format mp4`, `gif` or `png`.

`look` holds the options, `playback` says where everything is at a time between frames, `camera` where the eye is, `stage`
draws, `encode` writes. Drawing is VTK's, by whatever OpenGL the machine has, also in software; it needs no display.
"""
