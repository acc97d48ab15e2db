"""The camera-path language: from keyframes, moves and poses to the camera at any time."""
