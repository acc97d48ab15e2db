"""The reference upscaler: LR streams back to the display's size, so that errors in the data show."""
