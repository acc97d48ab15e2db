"""Ctrl-C and SIGTERM: both raise KeyboardInterrupt, and are remembered: libraries swallow what is raised while they load."""

import signal

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_came: list[int] = []


def listen() -> None:
    """From now on, both raise KeyboardInterrupt in the main thread."""
    for number in _SIGNALS:
        signal.signal(number, _remember)


def check() -> None:
    """Raises KeyboardInterrupt if one came, whoever caught it."""
    if _came:
        raise KeyboardInterrupt


def ignore() -> None:
    """While we leave, another one changes nothing."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _remember(number: int, _frame) -> None:
    _came.append(number)
    raise KeyboardInterrupt
