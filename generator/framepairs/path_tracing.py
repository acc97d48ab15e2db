"""`path` shading: Mitsuba's path tracer from primary rays that are fixed where a rasteriser would sample."""


class PathTracer:
    def __init__(self, scene, plan):
        raise NotImplementedError


def path_color(*_):
    raise NotImplementedError
