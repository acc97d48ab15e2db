"""Training corpora for neural super-sampling: rendered, validated, upscaled."""

__version__ = "0.1.0"
