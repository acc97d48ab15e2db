"""Mitsuba's XML: what Mitsuba's own parser makes of it, and what is refused."""

import os
import time

import numpy as np
import pytest

from framepairs.errors import InputError
from framepairs.scene.containment import Reach, reach_of
from framepairs.scene.mitsuba import load_mitsuba
from framepairs.scene.mitsuba_xml import parse_xml
from mitsuba_files import SCENE, write_scene

SINGLE = 2.0**-23


def parse(folder, text, version="3.0.0"):
    (folder / "s.xml").write_text(f'<scene version="{version}">{text}</scene>')
    return parse_xml(folder / "s.xml", Reach(folder.resolve()))


def transform(folder, steps):
    scene = parse(folder, f'<shape type="cube"><transform name="to_world">{steps}</transform></shape>').scene
    return np.array(scene["_arg_1"]["to_world"])


@pytest.mark.renders
@pytest.mark.parametrize(
    "steps",
    [
        '<translate x="1"/><scale value="2"/>',
        '<scale value="1, 2 3"/><translate value="4 5,6"/>',
        '<scale x="2"/><rotate y="1" angle="30"/>',
        '<rotate x="0.6" z="0.8" angle="-70"/>',
        '<rotate x="1" y="2" z="3" angle="20"/>',  # not of length 1: it distorts, in Mitsuba as here
        '<lookat origin="1,2,3" target="0 0.5 0" up="0, 1, 0"/>',
        '<lookat origin="0 5 0" target="0 0 0" up="0.1 0 1"/><translate z="1"/>',
        '<matrix value="1 2 3 4  5 6 7 8  9 10 12 13  0 0 0 1"/><translate x="1"/>',
        '<matrix value="1 2 3, 5 6 7, 9 10 12"/>',
    ],
)
def test_transforms_are_mitsubas(tmp_path, steps):
    from framepairs.backend import mi

    config = mi.parser.ParserConfig(mi.variant())
    text = f'<scene version="3.0.0"><shape type="cube"><transform name="to_world">{steps}</transform></shape></scene>'
    theirs = mi.parser.parse_string(config, text).nodes[1].props["to_world"]
    expected = np.array(theirs.matrix).reshape(4, 4)
    np.testing.assert_allclose(transform(tmp_path, steps), expected, rtol=4 * SINGLE, atol=8 * SINGLE)


def test_values_of_every_kind(tmp_path):
    document = parse(
        tmp_path,
        """<default name="n" value="4"/><default name="nn" value="0.25"/>
        <shape type="cube" id="box">
            <integer name="i" value="-12"/><float name="f" value=" $nn "/><boolean name="b" value="true"/>
            <string name="s" value="a$n b"/><point name="p" x="1" z="3"/><vector name="v" value="1, 2,3"/>
            <rgb name="c" value="0.1 0.2 0.3"/><rgb name="g" value="0.5"/><rgb name="h" value="#ff8000"/>
            <spectrum name="w" value="0.5"/><spectrum name="l" value="400:0.1, 500:0.2"/>
            <bsdf type="diffuse" name="own"/><ref id="other"/>
        </shape><alias id="paint" as="other"/><bsdf type="plastic" id="paint"/>""",
    )
    box = document.scene["_arg_1"]
    middle = ((128 / 255 + 0.055) / 1.055) ** 2.4
    assert box == {
        "type": "cube", "id": "box", "i": -12, "f": 0.25, "b": True, "s": "a4 b", "p": [1, 0, 3], "v": [1, 2, 3],
        "c": {"type": "rgb", "value": [0.1, 0.2, 0.3]}, "g": {"type": "rgb", "value": [0.5] * 3},
        "h": {"type": "rgb", "value": [1, pytest.approx(middle), 0]}, "w": {"type": "spectrum", "value": 0.5},
        "l": {"type": "spectrum", "value": [[400, 0.1], [500, 0.2]]}, "own": {"type": "diffuse"},
        "_arg_14": {"type": "ref", "id": "paint"},
    }  # fmt: skip
    assert document.places[id(box)] == (tmp_path / "s.xml", 2)


def test_old_files_are_brought_up_to_date(tmp_path):
    text = """<bsdf type="diffuse"><texture type="bitmap" name="diffuseReflectance">
        <float name="uscale" value="3"/><float name="uoffset" value="0.5"/></texture></bsdf>
        <bsdf type="dielectric"><string name="intIOR" value="water"/></bsdf>
        <shape type="cube"><transform name="toWorld"><translate x="1"/></transform></shape>"""
    scene = parse(tmp_path, text, "0.6.0").scene
    diffuse, dielectric, cube = (value for value in scene.values() if isinstance(value, dict))
    np.testing.assert_array_equal(diffuse["reflectance"]["to_uv"][0], [3, 0, 0, 1.5])  # as mi.parser.transform_upgrade has it
    assert dielectric == {"type": "dielectric", "int_ior": "water"}
    assert np.array(cube["to_world"])[0, 3] == 1


def test_includes_and_folders(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a.xml").write_text(
        '<scene version="3.0.0"><default name="k" value="2"/><shape type="cube" id="a"/></scene>'
    )
    (tmp_path / "parts" / "s.spd").write_text("# nm value\n400 0.5\n500 0.25\n")
    (tmp_path / "parts" / "m.obj").write_text("")
    document = parse(
        tmp_path,
        """<include filename="parts/a.xml"/><path value="parts"/><shape type="obj"><float name="x" value="$k"/>
        <string name="filename" value="m.obj"/></shape>
        <bsdf type="diffuse"><spectrum name="reflectance" filename="s.spd"/></bsdf>""",
    )
    a, mesh, bsdf = (value for value in document.scene.values() if isinstance(value, dict))
    assert (a["id"], mesh["x"], mesh["filename"]) == ("a", 2, str(tmp_path / "parts" / "m.obj"))
    assert bsdf["reflectance"] == {"type": "spectrum", "value": [[400, 0.5], [500, 0.25]]}
    assert [file.name for file in document.files] == ["s.xml", "a.xml", "s.spd"]


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<scene", "s.xml: not XML"),
        ("", "s.xml: not XML"),
        ("<shape type='cube'/>", "line 1: <shape> is no scene"),
        (f"{LAUGHS}<scene version='3.0.0'/>", "line 1: document type declarations and entities are not read"),
        ("<!DOCTYPE scene SYSTEM 'file:///etc/passwd'><scene version='3.0.0'/>", "document type declarations"),
        ("<scene version='3'/>", "version '3' is not three numbers"),
        ("<scene version='3.0.0'>\n<foo name='a'/></scene>", "line 2: <foo> is no element of a scene"),
        ("<scene version='3.0.0'>\n\n<float name='a' value='x'/></scene>", "line 3: 'x', numbers are expected"),
        ("<scene version='3.0.0'><float name='a' value='nan'/></scene>", "finite numbers are expected"),
        ("<scene version='3.0.0'><float name='a' value='1e999'/></scene>", "finite numbers are expected"),
        ("<scene version='3.0.0'><integer name='a' value='1.5'/></scene>", "an integer is expected"),
        ("<scene version='3.0.0'><boolean name='a' value='yes'/></scene>", "true or false is expected"),
        ("<scene version='3.0.0'><float value='1'/></scene>", "<float> without a name"),
        ("<scene version='3.0.0'><float name='type' value='1'/></scene>", "type as a name"),
        ("<scene version='3.0.0'><shape/></scene>", "<shape> without type"),
        ("<scene version='3.0.0'><float name='a' value='1'/><float name='a' value='1'/></scene>", "a stands there twice"),
        ("<scene version='3.0.0'><float name='a' value='$b'/></scene>", "undefined parameter in"),
        ("<scene version='3.0.0'><include filename='/etc/passwd'/></scene>", "line 1: /etc/passwd lies outside"),
        ("<scene version='3.0.0'><include filename='../s.xml'/></scene>", "line 1: ../s.xml lies outside"),
        ("<scene version='3.0.0'><include filename='s.xml'/></scene>", "includes in more than 15 levels"),
        ("<scene version='3.0.0'><path value='../..'/></scene>", "lies outside"),
        ("<scene version='3.0.0'><spectrum name='a' filename='/etc/passwd'/></scene>", "/etc/passwd lies outside"),
        ("<scene version='3.0.0'><spectrum name='a' value='1:2 3'/></scene>", "pairs of wavelength and value"),
        ("<scene version='3.0.0'><transform name='a'><rotate angle='3'/></transform></scene>", "rotation has no length"),
        ("<scene version='3.0.0'><transform name='a'><lookat origin='1' target='1'/></transform></scene>", "target is its"),
        ("<scene version='3.0.0'><transform name='a'><matrix value='1 2'/></transform></scene>", "a matrix of 2 numbers"),
        ("<scene version='3.0.0'><transform name='a'>" + "<scale value='1e300'/>" * 2 + "</transform></scene>", "not finite"),
        ("<scene version='3.0.0'><shape type='cube'><ref id='a'/></shape></scene>", "a: no object has the id 'a'"),
        ("<scene version='3.0.0'><bsdf type='twosided' id='a'><ref id='a'/></bsdf></scene>", "a: refers to itself"),
        ("<scene version='3.0.0'><bsdf type='null' id='a'/><bsdf type='null' id='a'/></scene>", "a: two objects have this id"),
        ("<scene version='3.0.0'>" + "<bsdf type='twosided'>" * 40 + "</bsdf>" * 40 + "</scene>", "deeper than 32"),
        ("<scene version='3.0.0'>" + "<a>" * 99 + "</a>" * 99 + "</scene>", "in each other"),
        ("<scene version='3.0.0'><shape type='evil'/></scene>", "unknown type 'evil'"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path, text, says):
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "s.xml").write_text("<scene version='3.0.0'/>")
    (folder / "s.xml").write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        load_mitsuba(folder / "s.xml", reach_of(folder / "s.xml"))
    assert str(folder / "s.xml") in str(caught.value)


def test_bombs_of_parameters_and_includes_are_refused(tmp_path):
    doubled = "".join(f'<default name="p{k + 1}q" value="$p{k}q$p{k}q"/>' for k in range(60))
    with pytest.raises(InputError, match="parameters stand for more than"):
        parse(tmp_path, f'<default name="p0q" value="ha"/>{doubled}')
    for k in range(14):
        twice = f'<include filename="{k + 1}.xml"/>' * 2
        (tmp_path / f"{k}.xml").write_text(f'<scene version="3.0.0">{twice}</scene>')
    (tmp_path / "14.xml").write_text('<scene version="3.0.0"/>')
    with pytest.raises(InputError, match="more than 1000 files are included"):
        parse(tmp_path, '<include filename="0.xml"/>')


def test_pipes_and_folders_are_not_read(tmp_path):
    os.mkfifo(tmp_path / "pipe.xml")
    for name in ("pipe.xml", "."):
        with pytest.raises(InputError, match="is no plain file"):
            parse(tmp_path, f'<include filename="{name}"/>')


def test_any_damage_to_a_scene_is_one_error_or_a_scene(tmp_path):
    file = write_scene(tmp_path)
    whole, random = SCENE.encode(), np.random.default_rng(11)
    begin, refused = time.process_time(), 0
    for _ in range(200):
        data = bytearray(whole)
        kind = random.integers(4)
        at, length = random.integers(0, len(data)), random.integers(1, 40)
        if kind == 0:
            data[at] = random.integers(0, 256)
        elif kind == 1:
            del data[at : at + length]
        elif kind == 2:
            other = random.integers(0, len(data))
            data[at:at] = data[other : other + length]
        else:  # another number where one stands
            digits = [k for k, byte in enumerate(data) if 48 <= byte <= 57]
            data[digits[at % len(digits)]] = ord(random.choice(list("-.e90")))
        file.write_bytes(data)
        try:
            load_mitsuba(file, reach_of(file))
        except InputError as error:
            refused += 1
            assert str(tmp_path) in str(error)
    assert refused > 50
    assert time.process_time() - begin < 60
