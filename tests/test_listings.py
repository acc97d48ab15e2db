"""The lists of what is bundled, and the page with their pictures."""

import base64
import re
from html.parser import HTMLParser

import pytest

from framepairs.bundled import camera_path_names, scene_names
from framepairs.errors import FramepairsError
from framepairs.listings import Listed, listed_cameras, listed_scenes, write_page


class Page(HTMLParser):
    """Images and text of a page; and whether its elements close."""

    def __init__(self):
        super().__init__()
        self.open, self.images, self.text, self.links = [], [], [], []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        if tag == "img":
            self.images.append(values)
        elif tag not in ("meta", "link", "br"):
            self.open.append(tag)
        self.links += [values[key] for key in ("href", "src") if key in values and not values[key].startswith("data:")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def read(file) -> Page:
    page = Page()
    page.feed(file.read_text())
    assert page.open == []
    return page


def test_every_scene_has_a_picture_a_story_and_what_it_stresses():
    entries = listed_scenes()
    assert [entry.name for entry in entries] == scene_names()
    for entry in entries:
        assert entry.picture is not None and entry.about.startswith(("A ", "An ", "The ")), entry.name
        assert len(entry.stresses) >= 4, entry.name


def test_every_camera_path_has_a_strip():
    entries = listed_cameras()
    assert [entry.name for entry in entries] == camera_path_names()
    assert all(entry.picture is not None and int(entry.facts["frames"]) >= 32 for entry in entries)


def test_the_page_holds_its_pictures_and_reads_nothing_else(tmp_path):
    picture = tmp_path / "a.jpg"
    picture.write_bytes(b"\xff\xd8 picture")
    facts = {"frames": "3 & 4"}
    named = Listed(name="<b>", file=tmp_path / "b.usda", picture=picture, facts=facts, about="a < b", stresses=("x",))
    bare = Listed(name="bare", file=tmp_path / "c.usda", picture=None, facts={})
    write_page("Two", [named, bare], tmp_path / "page.html")
    page = read(tmp_path / "page.html")
    inside = [base64.b64decode(re.sub("^data:image/jpeg;base64,", "", image["src"])) for image in page.images]
    assert inside == [picture.read_bytes()]
    text = " ".join(page.text)
    assert "<b>" in text and "3 & 4" in text and "a < b" in text and "bare" in text and page.links == []


def test_a_page_that_cannot_be_written_is_one_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(FramepairsError, match="page.html: cannot be written"):
        write_page("x", [], tmp_path / "file" / "page.html")
