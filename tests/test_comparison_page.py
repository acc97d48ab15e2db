"""The page with the slider: what is in it, and what a browser shows of it, to the pixel.

Pictures are made so that each pixel says which picture (red), frame (green) and place (blue) it is, and what the browser shows
is compared with arrays that NumPy enlarges: no tolerance, except next to the slider's line, which covers 14 pixels either side.
"""

import io
import json
import os
import re
import shutil
from dataclasses import dataclass, field
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np
import pytest
from PIL import Image

from framepairs.errors import InputError
from framepairs.upscaling.page import Compared, write_comparison

FRAMES = (3, 7, 20, 21)
SIZE = (48, 30)
SCALES = {"truth": 1, "lr_x2": 2, "lr_x2 temporal": 1, "lr_x3": 3}
VIEWPORT = {"width": 800, "height": 520}
MIDDLE = 400  # where the line is at first
SURROUND = (0x0C, 0x0D, 0x0F)
HANDLE = 16  # the slider's element is 28 pixels wide
NASTY = ["</script><script>alert(1)</script>", "<!-- <script>", "\"quoted\" & 'so' <b>", "Grün 漢字 \U0001f600", "a\\b\u2028c"]


def coded(name: str, frame: int, scale: int, size=SIZE) -> np.ndarray:
    """[height, width, 3] codes: red the picture, green the frame, blue the place."""
    y, x = np.mgrid[: size[1] // scale, : size[0] // scale]
    picture = list(SCALES).index(name) if name in SCALES else 5
    codes = np.empty((*x.shape, 3), np.uint8)
    codes[..., 0], codes[..., 1] = 40 * picture + 20, 10 * frame + 5
    codes[..., 2] = (37 * x + 101 * y + 64 * ((x + y) % 2)) % 256
    return codes


def compared(folder, sequence="market", scales=SCALES, size=SIZE, frames=FRAMES, figures=None) -> Compared:
    """The entry of one sequence, whose PNGs are written into `folder`."""
    pictures = {}
    for name, scale in scales.items():
        paths = []
        for frame in frames:
            file = folder / sequence / name / f"{frame:06d}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(coded(name, frame, scale, size)).save(file)
            paths.append(file.relative_to(folder).as_posix())
        pictures[name] = tuple(paths)
    return Compared(sequence=sequence, size=size, frames=tuple(frames), pictures=pictures, figures=figures or {})


def plain(**changes) -> Compared:
    """An entry without files behind it."""
    values = {"sequence": "market", "size": SIZE, "frames": (3, 7), "pictures": {"truth": ("a.png", "b.png")}, "figures": {}}
    return Compared(**values | changes)


def data_of(file) -> list[dict]:
    """What lies in the page, read as a browser does: a script ends at the first `</script`."""
    blocks = re.findall(r'<script id="data" type="application/json">(.*?)</script', file.read_text(), re.DOTALL)
    assert len(blocks) == 1
    return json.loads(blocks[0])


# Without a browser


def test_the_page_holds_what_was_given_in_its_order(tmp_path):
    pictures = {"truth": ("t/3.png", "t/7.png"), "lr_x2": ("l/3.png", "l/7.png"), "accumulate": ("a/3.png", "a/7.png")}
    entries = [plain(pictures=pictures, figures={"lr_x2": "24.1 dB  SSIM 0.81"}), plain(sequence="second", size=(7, 5))]
    write_comparison("title", entries, tmp_path / "new" / "page.html")
    first, second = data_of(tmp_path / "new" / "page.html")
    assert (first["name"], first["size"], first["frames"]) == ("market", [48, 30], [3, 7])
    assert [(item["name"], tuple(item["files"])) for item in first["pictures"]] == list(pictures.items())
    assert [item["figures"] for item in first["pictures"]] == ["", "24.1 dB  SSIM 0.81", ""]
    assert (second["name"], second["size"]) == ("second", [7, 5])


def test_names_that_would_end_the_script_survive(tmp_path):
    pictures = {name: (f"{name}.png",) for name in NASTY}
    entry = plain(sequence=NASTY[0], frames=(1,), pictures=pictures, figures=dict(zip(NASTY, reversed(NASTY), strict=True)))
    write_comparison(NASTY[0], [entry], tmp_path / "page.html")
    (data,) = data_of(tmp_path / "page.html")
    assert data["name"] == NASTY[0]
    assert [item["name"] for item in data["pictures"]] == NASTY
    assert [item["files"] for item in data["pictures"]] == [[f"{name}.png"] for name in NASTY]
    assert [item["figures"] for item in data["pictures"]] == NASTY[::-1]
    text = (tmp_path / "page.html").read_text()
    assert "<title>&lt;/script&gt;&lt;script&gt;" in text and "<script>alert" not in text


def test_two_writes_give_equal_bytes(tmp_path):
    for name in ("a.html", "b.html"):
        write_comparison("title", [plain()], tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([], "no sequence"),
        ([plain(frames=())], "'market': nothing to compare: no frames or no pictures"),
        ([plain(pictures={})], "'market': nothing to compare: no frames or no pictures"),
        ([plain(pictures={"truth": ("a.png",)})], "'market': 1 pictures of 'truth' for 2 frames"),
        ([plain(frames=(3,))], "'market': 2 pictures of 'truth' for 1 frames"),
        ([plain(), plain()], "'market': stands twice"),
        ([plain(figures={"thruth": "1 dB"})], "'market': a figure for 'thruth', of which there are no pictures"),
    ],
)
def test_what_cannot_be_compared_is_refused(tmp_path, entries, message):
    with pytest.raises(InputError) as refused:
        write_comparison("title", entries, tmp_path / "page.html")
    assert message in str(refused.value) and not (tmp_path / "page.html").exists()


def test_where_it_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "folder").mkdir()
    for file in (tmp_path / "file" / "page.html", tmp_path / "folder"):
        with pytest.raises(InputError, match="cannot be written") as refused:
            write_comparison("title", [plain()], file)
        assert str(tmp_path) in str(refused.value)


# In a browser


@dataclass
class Opened:
    """A page in a browser, and what it asked for and complained of."""

    page: object
    requests: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def listeners(self) -> dict:
        return {
            "request": lambda request: self.requests.append(request.url),
            "console": lambda message: self.errors.append(message.text),
            "pageerror": lambda error: self.errors.append(str(error)),
        }

    def wait_for(self, frame: int, left: str | None = None, right: str | None = None) -> None:
        """Until the canvas says that it shows them."""
        pattern = f"^left {re.escape(left) if left else '.*'}, right {re.escape(right) if right else '.*'}, frame {frame}$"
        self.page.wait_for_function("p => new RegExp(p).test(picture.getAttribute('aria-label'))", arg=pattern, timeout=5000)
        self.settle()

    def settle(self) -> None:
        """Until what was asked for has been drawn."""
        self.page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def stage(self) -> np.ndarray:
        """[height, width, 3] device pixels of the stage."""
        self.settle()
        ratio, width, height = self.page.evaluate("[devicePixelRatio, picture.width, picture.height]")
        shot = np.asarray(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"))
        top = round(self.page.locator("#picture").bounding_box()["y"] * ratio)
        return shot[top : top + height, :width]

    def view(self) -> dict[str, str]:
        """The parts of the address, written at last."""
        self.page.evaluate("remember()")
        return {key: value[0] for key, value in parse_qs(urlsplit(self.page.url).fragment).items()}

    def border(self) -> float:
        """Of left and right, in CSS pixels."""
        box = self.page.locator("#slider").bounding_box()
        return box["x"] + box["width"] / 2

    def middle(self) -> tuple[float, float]:
        box = self.page.locator("#picture").bounding_box()
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="the package playwright is not installed")
    names = ("chromium", "chromium-browser", "google-chrome")
    chromium = os.environ.get("FRAMEPAIRS_CHROMIUM") or next(filter(None, map(shutil.which, names)), None)
    if chromium is None:
        pytest.skip(f"no browser: none of {', '.join(names)} is in PATH, and FRAMEPAIRS_CHROMIUM is not set")
    quiet = [
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--no-first-run",
    ]
    with playwright.sync_playwright() as started:
        launched = started.chromium.launch(executable_path=chromium, args=["--no-sandbox", *quiet])
        yield launched
        launched.close()


@pytest.fixture(scope="module")
def kept_page(browser):
    """Of one context, as opening costs more than most tests."""
    return browser.new_context(viewport=VIEWPORT).new_page()


@pytest.fixture
def open_page(browser, kept_page):
    """Opens pages; afterwards: nothing but files was asked for, and nothing was complained of."""
    everything, quiet = [], []

    def opened(file, fragment="", *, expect_errors=False, frame=FRAMES[0], **options) -> Opened:
        fresh = bool(everything or options)
        page = browser.new_context(**{"viewport": VIEWPORT} | options).new_page() if fresh else kept_page
        result = Opened(page)
        everything.append((result, fresh, listeners := result.listeners()))
        if not expect_errors:
            quiet.append(result)
        for event, listener in listeners.items():
            page.on(event, listener)
        page.goto(file.as_uri() + fragment)
        result.wait_for(frame)
        return result

    yield opened
    for result, fresh, listeners in everything:
        for event, listener in listeners.items():
            result.page.remove_listener(event, listener)
        result.page.context.close() if fresh else result.page.goto("about:blank")
    for result in quiet:
        assert result.errors == []
        assert all(url.startswith("file:///") for url in result.requests), result.requests
        assert all(url.split("#")[0].endswith((".html", ".png")) for url in result.requests), result.requests


@pytest.fixture(scope="module")
def corpus_page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    figures = {"lr_x2": "20.5 dB", "lr_x2 temporal": "24.1 dB  SSIM 0.81"}
    write_comparison("pictures", [compared(folder, figures=figures)], folder / "page.html")
    return folder / "page.html"


def expected(shape, zoom: float, corner: tuple[int, int], border: int, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """What the stage shows of two pictures that span `SIZE`, enlarged without smoothing; corner: of the picture, pixels."""
    result = np.empty(shape, np.uint8)
    for picture, columns in ((left, slice(0, border)), (right, slice(border, None))):
        y, x = (np.arange(length) - start for length, start in zip(shape, corner[::-1], strict=False))
        rows, across = (
            np.floor_divide(i * n, zoom * m).astype(int) for i, n, m in zip((y, x), picture.shape, SIZE[::-1], strict=False)
        )
        inside = ((rows >= 0) & (rows < len(picture)))[:, None] & (across >= 0) & (across < picture.shape[1])
        shown = picture[rows.clip(0, len(picture) - 1)][:, across.clip(0, picture.shape[1] - 1)]
        result[:, columns] = np.where(inside[..., None], shown, np.uint8(SURROUND))[:, columns]
    return result


def assert_shows(stage: np.ndarray, *, zoom: int, border: int, left, right, corner=None, ratio=1) -> None:
    """corner: (x, y) of the picture's upper left; None where it is centred."""
    height, width, _ = stage.shape
    # JavaScript rounds halves up
    centred = tuple(int(np.floor((length - zoom * own) / 2 + 0.5)) for length, own in zip((width, height), SIZE, strict=True))
    answer = expected(stage.shape, zoom, corner or centred, border, left, right)
    covered = np.abs(np.arange(width) - border) <= HANDLE * ratio
    wrong = (stage != answer).any(axis=2) & ~covered
    assert not wrong.any(), f"{wrong.sum()} pixels, the first at {np.argwhere(wrong)[0]}"


@pytest.mark.parametrize(
    ("left", "right", "ratio"), [("truth", "lr_x2", 1), ("lr_x3", "lr_x2 temporal", 1), ("truth", "lr_x2", 2)]
)
def test_each_side_of_the_line_shows_its_picture_enlarged_to_the_truth(open_page, corpus_page, left, right, ratio):
    options = {"device_scale_factor": ratio} if ratio != 1 else {}
    opened = open_page(corpus_page, f"#left={left}&right={right}&frame=7", frame=7, **options)
    stage = opened.stage()
    assert stage.shape[1] == 800 * ratio
    zoom = min(32, stage.shape[0] // SIZE[1])  # the stage is wider than the picture, which is enlarged by a whole factor
    pictures = {"left": coded(left, 7, SCALES[left]), "right": coded(right, 7, SCALES[right])}
    assert_shows(stage, zoom=zoom, border=MIDDLE * ratio, ratio=ratio, **pictures)
    assert opened.page.locator("#zoom").text_content() == f"{zoom}×"


def test_the_first_view_names_pictures_and_figures(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    assert page.title() == "pictures" and page.get_by_role("heading").text_content() == "pictures"
    opened.wait_for(3, "truth", "lr_x2")
    assert page.locator("#left-figures").text_content() == "" and page.locator("#right-figures").text_content() == "20.5 dB"
    page.get_by_label("Right", exact=True).select_option(label="3: lr_x2 temporal")
    opened.wait_for(3, "truth", "lr_x2 temporal")
    assert page.locator("#right-figures").text_content() == "24.1 dB  SSIM 0.81"
    assert not page.get_by_label("Sequence", exact=True).is_visible()  # there is one


def test_dragging_and_keys_move_the_line(open_page, corpus_page):
    opened = open_page(corpus_page)
    page, pictures = opened.page, {"left": coded("truth", 3, 1), "right": coded("lr_x2", 3, 2)}
    zoom = opened.stage().shape[0] // SIZE[1]
    page.mouse.move(396, 300)  # beside the line, which keeps its distance from the pointer
    page.mouse.down()
    page.mouse.move(300, 320)
    page.mouse.move(236, 900)
    page.mouse.up()
    page.mouse.move(700, 300)  # no longer held
    assert_shows(opened.stage(), zoom=zoom, border=240, **pictures)
    assert opened.border() == pytest.approx(240, abs=0.01)
    slider = page.get_by_role("slider", name="Border")
    slider.focus()
    for key, share in [
        ("Home", 0),
        ("ArrowRight", 0.01),
        ("PageUp", 0.11),
        ("Shift+ArrowRight", 0.21),
        ("ArrowLeft", 0.2),
        ("ArrowUp", 0.21),
        ("ArrowRight", 0.22),
    ]:
        page.keyboard.press(key)
        opened.settle()
        assert opened.border() == pytest.approx(800 * share, abs=0.51)  # a whole device pixel
        assert slider.get_attribute("aria-valuenow") == str(round(100 * share))
    assert_shows(opened.stage(), zoom=zoom, border=176, **pictures)
    page.keyboard.press("End")
    assert_shows(opened.stage(), zoom=zoom, border=800, **pictures)
    opened.wait_for(3)  # the arrows were the slider's


def test_the_line_is_dragged_by_touch(open_page, corpus_page):
    opened = open_page(corpus_page, has_touch=True)
    device = opened.page.context.new_cdp_session(opened.page)
    for kind, points in [("Start", [(400, 300)]), ("Move", [(460, 310)]), ("Move", [(600, 310)]), ("End", [])]:
        touches = [{"x": x, "y": y} for x, y in points]
        device.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": touches})
    stage = opened.stage()
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=600, left=coded("truth", 3, 1), right=coded("lr_x2", 3, 2))


def test_scrubber_buttons_and_keys_change_the_frame(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    scrubber, press = page.get_by_role("slider", name="Frame"), page.keyboard.press
    steps = [
        (20, lambda: scrubber.fill("2")),
        (21, lambda: press(".")),
        (21, lambda: press(".")),  # the last
        (20, lambda: press(",")),
        (7, lambda: page.get_by_role("button", name="Previous frame").click()),
        (20, lambda: page.get_by_role("button", name="Next frame").click()),
        (7, lambda: (page.mouse.click(5, 300), press("ArrowLeft"))),
        (20, lambda: press("ArrowRight")),
        (3, lambda: (scrubber.focus(), press("Home"))),
        (7, lambda: press("ArrowRight")),
    ]
    for frame, step in steps:
        step()
        opened.wait_for(frame, "truth", "lr_x2")
        assert page.locator("#number").text_content() == str(frame)
        assert scrubber.get_attribute("aria-valuetext") == f"frame {frame}"
        assert scrubber.input_value() == str(FRAMES.index(frame))
    stage = opened.stage()
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=MIDDLE, left=coded("truth", 7, 1), right=coded("lr_x2", 7, 2))


def test_digits_choose_pictures_also_while_a_select_has_the_focus(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    steps = [
        ("4", "truth", "lr_x3"),
        ("Shift+3", "lr_x2 temporal", "lr_x3"),
        ("x", "lr_x3", "lr_x2 temporal"),
        ("9", None, None),
    ]
    for key, left, right in steps:
        page.keyboard.press(key)
        opened.wait_for(3, left or "lr_x3", right or "lr_x2 temporal")
        page.get_by_label("Left", exact=True).focus()
    stage = opened.stage()
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=MIDDLE, left=coded("lr_x3", 3, 3), right=coded("lr_x2 temporal", 3, 1))


def test_the_wheel_zooms_around_the_pointer_and_dragging_pans_both_sides(open_page, corpus_page):
    opened = open_page(corpus_page)
    page, pictures = opened.page, {"left": coded("truth", 3, 1), "right": coded("lr_x2", 3, 2)}
    stage = opened.stage()
    height, width, _ = stage.shape
    top, before = page.locator("#picture").bounding_box()["y"], stage.shape[0] // SIZE[1]
    pointer = (251, round(top) + 130)
    corner = [(width - before * SIZE[0]) / 2, (height - before * SIZE[1]) / 2]
    under = [(pointer[0] - corner[0]) / before, (pointer[1] - round(top) - corner[1]) / before]  # picture pixels
    page.mouse.move(*pointer)
    for _ in range(3):
        page.mouse.wheel(0, -100)
        opened.settle()
    text = page.locator("#zoom").text_content()
    zoom = int(text[:-1])
    assert text == "24×" and zoom > before
    stage, view = opened.stage(), opened.view()
    corner = tuple(int(np.floor(length / 2 - float(view[axis]) * zoom + 0.5)) for length, axis in ((width, "x"), (height, "y")))
    # the point stays under the pointer: half a pixel for the rounding of the corner, 1e-3 for the address' digits times 32
    assert np.allclose(
        [pointer[0] - corner[0], pointer[1] - round(top) - corner[1]], np.multiply(under, zoom), atol=0.51, rtol=0
    )
    assert_shows(stage, zoom=zoom, border=MIDDLE, corner=corner, **pictures)

    page.mouse.move(200, 300)
    page.mouse.down()
    page.mouse.move(150, 280)
    page.mouse.move(163, 317)
    page.mouse.up()
    page.mouse.move(300, 400)
    moved = (corner[0] - 37, corner[1] + 17)
    assert_shows(opened.stage(), zoom=zoom, border=MIDDLE, corner=moved, **pictures)

    page.mouse.dblclick(200, 300)
    assert_shows(opened.stage(), zoom=before, border=MIDDLE, **pictures)
    assert opened.view()["zoom"] == "fit"


def test_buttons_and_keys_zoom_within_the_limits(open_page, corpus_page):
    opened = open_page(corpus_page)
    page, shown = opened.page, opened.page.locator("#zoom")
    fitted = shown.text_content()
    for _ in range(12):
        page.get_by_role("button", name="Zoom in").click()
    assert shown.text_content() == "32×"
    page.get_by_role("button", name="Fit").click()
    assert shown.text_content() == fitted
    for _ in range(30):
        page.keyboard.press("-")
    assert shown.text_content() == "1×"
    pictures = {"left": coded("truth", 3, 1), "right": coded("lr_x2", 3, 2)}
    assert_shows(opened.stage(), zoom=1, border=MIDDLE, **pictures)
    for text in ("1.5×", "2×"):
        page.keyboard.press("+")
        assert shown.text_content() == text
    assert_shows(opened.stage(), zoom=2, border=MIDDLE, **pictures)
    page.get_by_role("button", name="Zoom in").focus()
    page.keyboard.press("Space")  # is the button's, where one has the focus
    assert shown.text_content() == "3×" and not page.evaluate("playing")
    page.keyboard.press("0")
    assert shown.text_content() == fitted


def test_only_full_size_pictures_below_two_are_smoothed(open_page, tmp_path):
    entry = compared(tmp_path, frames=(1,), scales={"truth": 1, "lr_x2": 2})
    stripes = np.zeros((30, 48, 3), np.uint8)
    stripes[:, ::2] = 255
    Image.fromarray(stripes).save(tmp_path / entry.pictures["truth"][0])
    write_comparison("smoothed", [entry], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html", "#zoom=1.5", frame=1)
    stage = opened.stage()
    row = stage[stage.shape[0] // 2, MIDDLE - 35 : MIDDLE - HANDLE, 0]  # 36 pixels of the picture are left of the line
    assert ((row > 0) & (row < 255)).any()
    opened.page.keyboard.press("Shift+2")
    opened.wait_for(1, "lr_x2", "lr_x2")
    lr = coded("lr_x2", 1, 2)
    assert_shows(opened.stage(), zoom=1.5, border=MIDDLE, left=lr, right=lr)  # 3 device pixels per LR pixel


def test_a_picture_larger_than_the_window_is_fitted_whole(open_page, tmp_path):
    entry = compared(tmp_path, scales={"truth": 1, "lr_x2": 2}, size=(1920, 1080), frames=(1,))
    write_comparison("large", [entry], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html", frame=1)
    stage = opened.stage()
    zoom = min(stage.shape[1] / 1920, stage.shape[0] / 1080)
    assert opened.page.locator("#zoom").text_content() == f"{zoom:.2f}".rstrip("0") + "×"
    inside = np.argwhere((stage != SURROUND).any(axis=2))
    for length, own, low, high in zip(stage.shape, (1080, 1920), inside.min(axis=0), inside.max(axis=0), strict=False):
        assert low == pytest.approx((length - zoom * own) / 2, abs=1)  # whole pixels, and a blended one at the edge
        assert high + 1 == pytest.approx((length + zoom * own) / 2, abs=1)


def test_the_address_opens_the_same_view_elsewhere(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    page.keyboard.press(".")
    page.keyboard.press("3")
    page.mouse.move(250, 250)
    page.mouse.wheel(0, -100)
    page.mouse.move(401, 300)
    page.mouse.down()
    page.mouse.move(185, 300)
    page.mouse.up()
    opened.wait_for(7, "truth", "lr_x2 temporal")
    page.wait_for_url("**slider=0.23**")  # written by itself, after a while
    view = opened.view()
    assert {"sequence", "frame", "left", "right", "slider", "zoom", "x", "y"} == set(view)
    assert (view["frame"], view["right"], view["zoom"]) == ("7", "lr_x2 temporal", "12")
    stage, fragment = opened.stage(), urlsplit(page.url).fragment
    page.goto("about:blank")
    page.goto(corpus_page.as_uri() + "#" + fragment)
    opened.wait_for(7, "truth", "lr_x2 temporal")
    assert np.array_equal(opened.stage(), stage)
    opened.page.evaluate("location.hash = '#frame=21&zoom=fit&slider=0.75'")  # a link into a page that is open
    opened.wait_for(21, "truth", "lr_x2 temporal")
    assert opened.view()["zoom"] == "fit" and opened.border() == pytest.approx(600, abs=0.01)


MALFORMED = [
    "#%E0%A4%A&&&=",
    "#",
    "#sequence=none&frame=4&left=nothing&right=&zoom=NaN&x=1e999&y=&slider=two",
    "#zoom=1e9&x=-5&y=NaN&slider=-1&frame=1e0",
    "#zoom=0&slider=&frame=",
    "#__proto__=1&left=__proto__&frame=constructor&" + "x" * 5000,
]


def test_what_an_address_says_wrongly_is_ignored(open_page, corpus_page):
    opened = open_page(corpus_page, MALFORMED[0])
    first = {"sequence": "market", "frame": "3", "left": "truth", "right": "lr_x2", "slider": "0.5", "zoom": "fit"}
    for fragment in MALFORMED:
        opened.page.evaluate("fragment => { location.hash = fragment; }", fragment)
        opened.settle()
        assert opened.view() == first, fragment
    stage = opened.stage()
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=MIDDLE, left=coded("truth", 3, 1), right=coded("lr_x2", 3, 2))


def test_a_missing_picture_is_named_and_the_other_side_stays(open_page, tmp_path):
    entry = compared(tmp_path)
    (tmp_path / entry.pictures["lr_x2"][1]).unlink()
    (tmp_path / entry.pictures["lr_x2"][2]).write_bytes(b"no PNG")
    write_comparison("missing", [entry], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html", expect_errors=True)  # Chromium itself writes to the console
    alert = opened.page.get_by_role("alert")
    assert not alert.is_visible()
    for index in (1, 2):
        opened.page.keyboard.press(".")
        opened.wait_for(FRAMES[index])
        assert alert.text_content() == f"Right: lr_x2, frame {FRAMES[index]}: {entry.pictures['lr_x2'][index]} cannot be loaded"
        stage = opened.stage()
        below = stage[round(alert.bounding_box()["height"]) + 1 :]
        assert (below[:, MIDDLE + HANDLE :] == SURROUND).all()  # no picture of another frame
        assert (below[stage.shape[0] // 2, MIDDLE - 2 * HANDLE] == coded("truth", FRAMES[index], 1)[0, 0])[:2].all()
    opened.page.keyboard.press("x")
    opened.wait_for(20, "lr_x2", "truth")
    assert alert.text_content().startswith("Left: lr_x2, frame 20: ")
    opened.page.keyboard.press(".")
    opened.wait_for(21)
    assert not alert.is_visible()


def test_neighbours_are_loaded_ahead_and_the_old_picture_stays_meanwhile(open_page, tmp_path):
    frames = tuple(range(20))
    entry = compared(tmp_path, scales={"truth": 1, "lr_x2": 2}, frames=frames)
    write_comparison("scrub", [entry], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html", "#frame=10", frame=10)
    page, pictures = opened.page, entry.pictures
    page.wait_for_load_state("networkidle")
    loaded = {unquote(url) for url in opened.requests}
    for name in ("truth", "lr_x2"):
        for frame in (9, 11):
            assert any(url.endswith(pictures[name][frame]) for url in loaded), (name, frame)
        assert not any(url.endswith(pictures[name][15]) for url in loaded)
    page.evaluate("""() => {
      const decode = Image.prototype.decode, released = new Promise(done => { window.release = done; });
      Image.prototype.decode = function () {
        return this.src.endsWith("lr_x2/000015.png") ? released.then(() => decode.call(this)) : decode.call(this);
      };
    }""")
    page.get_by_role("slider", name="Frame").fill("15")
    page.wait_for_timeout(150)
    assert page.locator("#number").text_content() == "15"
    stage = opened.stage()
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=MIDDLE, left=coded("truth", 10, 1), right=coded("lr_x2", 10, 2))  # never 15 beside 10
    page.evaluate("release()")
    opened.wait_for(15)
    assert_shows(opened.stage(), zoom=zoom, border=MIDDLE, left=coded("truth", 15, 1), right=coded("lr_x2", 15, 2))


def test_playing_shows_every_frame_in_turn_at_the_rate(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    page.get_by_label("Rate").select_option("30")
    page.evaluate("""() => {
      window.seen = [];
      const watch = () => seen.push([performance.now(), picture.getAttribute("aria-label").split(" ").at(-1)]);
      new MutationObserver(watch).observe(picture, {attributeFilter: ["aria-label"]});
    }""")
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("seen.length > 12", timeout=5000)
    page.get_by_role("button", name="Pause").click()
    seen = page.evaluate("seen")
    numbers = [int(frame) for (_, frame), (_, before) in zip(seen[1:], seen, strict=False) if frame != before]
    start = FRAMES.index(numbers[0])
    assert numbers == [FRAMES[(start + i) % 4] for i in range(len(numbers))] and len(numbers) >= 4
    times = [time for time, _ in seen]
    # never faster than asked; one interval may be caught up, and each is up to a refresh of the screen (17 ms) off
    assert times[-1] - times[0] > (len(numbers) - 2) * 1000 / 30 - 34
    rest = page.evaluate("view.frame")
    page.wait_for_timeout(120)
    assert page.evaluate("view.frame") == rest
    page.mouse.click(5, 300)
    page.keyboard.press("Space")
    assert page.get_by_role("button", name="Pause").get_attribute("aria-pressed") == "true"


def test_another_sequence_keeps_what_it_can(open_page, tmp_path):
    other = {"lr_x3": 3, "truth": 1, "lr_x2": 2}
    second = compared(tmp_path, "ruins & co", other, frames=(2, 7, 8))
    write_comparison("two", [compared(tmp_path), second], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html", "#frame=7&zoom=24&x=20&y=10", frame=7)
    opened.page.get_by_label("Sequence", exact=True).select_option(label="ruins & co")
    opened.page.wait_for_function("picture.getAttribute('aria-label') && shown.sequence === 1")
    opened.wait_for(7, "truth", "lr_x2")
    view = opened.view()
    assert (view["sequence"], view["frame"], view["zoom"], view["x"]) == ("ruins & co", "7", "24", "20")
    assert opened.page.get_by_label("Right", exact=True).evaluate("select => select.selectedIndex") == 2
    opened.page.keyboard.press(".")
    opened.wait_for(8)
    opened.view()
    opened.page.reload()
    opened.wait_for(8, "truth", "lr_x2")
    assert opened.view()["sequence"] == "ruins & co"


def test_names_and_files_with_special_characters_show(open_page, tmp_path):
    scales = {"100 % #1?": 1, "a&b=c+d": 2, "<b> Grün 漢字": 1}
    entry = compared(tmp_path, "se quence%20#", scales)
    write_comparison(NASTY[0], [entry], tmp_path / "page.html")
    opened = open_page(tmp_path / "page.html")
    assert opened.page.title() == NASTY[0]
    opened.wait_for(3, "100 % #1?", "a&b=c+d")
    assert not opened.page.get_by_role("alert").is_visible()
    assert opened.page.get_by_label("Right", exact=True).evaluate("select => select.options[2].text") == "3: <b> Grün 漢字"
    opened.page.keyboard.press("3")
    opened.wait_for(3, "100 % #1?", "<b> Grün 漢字")
    opened.page.keyboard.press("Shift+2")
    opened.wait_for(3, "a&b=c+d", "<b> Grün 漢字")
    opened.view()
    opened.page.reload()
    opened.wait_for(3, "a&b=c+d", "<b> Grün 漢字")


def test_everything_fits_into_every_window(open_page, corpus_page):
    opened = open_page(corpus_page)
    page = opened.page
    for width, height in ((1280, 720), (480, 800), (360, 640), (VIEWPORT["width"], VIEWPORT["height"])):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function("size => size[0] === picture.width && size[1] === innerHeight", arg=[width, height])
        sizes = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
        assert sizes == [width, height]
        assert page.locator("#stage").bounding_box()["height"] > height / 2
        boxes = page.evaluate("""() => [...document.querySelectorAll("select, input, button, output")].map(item => {
          const box = item.getBoundingClientRect();
          return [item.id, box.left, box.right];
        })""")
        assert len(boxes) == 15
        for name, left, right in boxes:
            assert 0 <= left <= right <= width, name
    stage = opened.stage()  # fitted again
    zoom = stage.shape[0] // SIZE[1]
    assert_shows(stage, zoom=zoom, border=MIDDLE, left=coded("truth", 3, 1), right=coded("lr_x2", 3, 2))


def test_every_control_is_reached_by_tab_has_a_name_and_shows_the_focus(open_page, corpus_page):
    opened = open_page(corpus_page)
    page, reached = opened.page, []
    for _ in range(20):
        page.keyboard.press("Tab")
        now, name, outline = page.evaluate("""() => {
          const now = document.activeElement, label = now.labels?.[0]?.textContent;
          return [now.tagName, now.ariaLabel || label || now.textContent, getComputedStyle(now).outlineStyle];
        }""")
        if now == "BODY" or name in reached:
            break
        assert name and outline == "solid", name
        reached.append(name)
    border = "Border between left and right"
    buttons = ["Previous frame", "Next frame", "Frame", "Play", "Rate", "Zoom out", "Zoom in", "Fit", "Keys"]
    assert reached == ["Left", "Right", border, *buttons]
