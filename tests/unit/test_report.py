"""A report made by a script, read in a real browser: what the page shows is what was computed."""

import base64
import json
import re
from importlib import resources

import numpy as np
import pytest
from browser import Browser, find_browser

from gibiane.session import Session
from gibiane_ops.kernels.report.words import FRENCH
from gibiane_ops.kernels.report.writing import NO_SCRIPT

SCRIPT = """
OPTI DIME 3 ELEM CUB8 SORT '{path}' ;
S = (DROI 4 (0. 0. 0.) (2. 0. 0.)) TRAN 3 (0. 1. 0.) ; V = S VOLU 2 'TRAN' (0. 0. 1.) ;
MO = MODE V 'MECANIQUE' 'ELASTIQUE' ; MA = MATE MO 'YOUN' 2.E5 'NU' 0.3 ;
CL = BLOQ 'DEPL' (V POIN 'PLAN' (0. 0. 0.) (0. 1. 0.) (0. 0. 1.) 1.E-6) ;
U = RESO ((RIGI MO MA) ET CL) (FSUR 'MASS' MO (0. 0. -100.) (FACE 2 V)) ;
X CARTE = ERREUR 'SPR' MO (SIGM MO MA U) MA ;
TEMPS = PROG 0.5 2. 11. {time} ;
E1 = EVOL 'MANU' 'LEGE' 'CUB8' 'time (s)' TEMPS 'error (%)' (PROG 22. 11. 5.3 2.6) ;
E2 = EVOL 'MANU' 'LEGE' 'CU20, adaptive' 'time (s)' (PROG 1.5 5. 21.) 'error (%)' (PROG 19. 6. 1.3) ;
R = TABL ; R . 'date' = '2026-11-28' ; R . 'numpy' = '2.4.6' ; R . 'runs' = 3 ;
C = TABL ; C . 'COURBES' = E1 ET E2 ; C . 'LOGX' = VRAI ; C . 'LOGY' = VRAI ; C . 'PARETO' = VRAI ;
C . 'NOM' = 'cost' ;
C . 'NOTES' = TABL ; C . 'NOTES' . 1 = TABL ; C . 'NOTES' . 1 . 4 = R ;
B = TABL ; B . 'COLONNES' = TABL ; B . 'COLONNES' . 'case' = MOTS 'T1' 'T2' ;
B . 'COLONNES' . 'error' = PROG 12.5 4.25 ;
G = TABL ; G . 'MAILLAGE' = V ; G . 'NOM' = 'block' ; G . 'DEPLACEMENT' = U ;
G . 'CHAMP' = TABL ; G . 'CHAMP' . 'U' = U ; G . 'CHAMP' . 'error map' = CARTE ;
G . 'VECTEUR' = VECT (REDU U (FACE 2 V)) 'DEPL' 'ROUG' ;
T = TABL ; T . 'TITRE' = 'A <study>' ; P = TABL ; P . 'TITRE' = 'Words & numbers' ;
P . 1 = 'not </script> the end' ; P . 2 = B ; T . 1 = P ;
P = TABL ; P . 'TITRE' = 'Cost' ; P . 1 = C ; T . 2 = P ; P = TABL ; P . 'TITRE' = 'Views' ; P . 1 = G ; T . 3 = P ;
SORT 'HTML' T ;
"""


def written(folder, time="60.", language=None):
    """Run the script; return its session and the file."""
    path = folder / "report.html"
    session = Session()
    session.options["LANG"] = language
    session.run_text(SCRIPT.format(path=path.as_posix(), time=time), "report.dgibi")
    assert session.worst == 0
    return session, path


def data_of(path):
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL).group(1))


def reals(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), "<f8")


def integers(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), "<i4")


def at_node(session, component, number):
    nodes, values = session.globals.names["U"].parts[component]
    return float(values[np.searchsorted(nodes, number - 1)])


# ---------------------------------------------------------------- the file


def test_the_file_needs_no_network_and_texts_cannot_break_it(tmp_path):
    _, path = written(tmp_path)
    text = path.read_text(encoding="utf-8")
    assert not re.search(r'(?:src|href)\s*=\s*"(?!data:)', text)
    assert "A &lt;study&gt;" in text
    assert data_of(path)["pages"][0]["blocks"][0]["text"] == "not </script> the end"


def test_fields_of_the_file_are_the_computed_ones_to_the_last_bit(tmp_path):
    session, path = written(tmp_path)
    view = data_of(path)["pages"][2]["blocks"][0]
    nodes = integers(view["nodes"])
    fields = {f["name"]: f for f in view["fields"]}
    assert list(fields) == ["U UX", "U UY", "U UZ", "error map"]
    store = session.globals.names["V"].store
    np.testing.assert_array_equal(reals(view["points"]).reshape(-1, 3), store.coords[nodes - 1])
    for component in ("UX", "UY", "UZ"):
        np.testing.assert_array_equal(
            reals(fields[f"U {component}"]["values"]), session.globals.names["U"].at(component, nodes - 1)
        )
    elements = integers(view["elements"])
    zone = session.globals.names["CARTE"].zones[0]
    np.testing.assert_array_equal(
        reals(fields["error map"]["values"]), zone.component("SCAL").mean(axis=1)[elements - 1]
    )
    # each facet belongs to the element that the page names
    facet = reals(view["points"]).reshape(-1, 3)[integers(view["triangles"]).reshape(-1, 3)]
    cells = session.globals.names["V"].blocks[0].cells[elements[integers(view["owner"])] - 1]
    low, high = store.coords[cells].min(axis=1), store.coords[cells].max(axis=1)
    assert (facet >= low[:, None] - 1e-12).all()
    assert (facet <= high[:, None] + 1e-12).all()


def test_the_environment_names_the_machine_and_the_versions(tmp_path):
    _, path = written(tmp_path)
    page = data_of(path)["pages"][-1]
    rows = dict(page["blocks"][0]["rows"])
    assert page["title"] == "Environment"
    assert rows["numpy"] == np.__version__
    assert int(rows["Cores"]) >= 1


def test_every_word_of_the_page_has_a_french_one():
    folder = resources.files("gibiane_ops.kernels.report")
    scripts = "".join(
        each.read_text(encoding="utf-8") for each in (folder / "page").iterdir() if each.name[-3:] == ".js"
    )
    python = "".join(
        each.read_text(encoding="utf-8")
        for each in folder.iterdir()
        if each.name[-3:] == ".py" and each.name != "words.py"
    )
    python += (resources.files("gibiane_ops.output") / "report.py").read_text(encoding="utf-8")
    used = set(re.findall(r'said\("([^"]+)"', scripts + python)) | {NO_SCRIPT}
    assert used == set(FRENCH)
    assert all(FRENCH.values())


def test_a_report_speaks_the_language_of_the_session(tmp_path):
    _, path = written(tmp_path, language="FRAN")
    assert '<html lang="fr">' in path.read_text(encoding="utf-8")
    data = data_of(path)
    assert data["pages"][-1]["title"] == "Environnement"
    assert data["pages"][-1]["blocks"][0]["head"] == ["Quoi", "Valeur"]
    assert data["pages"][1]["blocks"][0]["caption"].startswith("Front de Pareto")
    assert data["words"]["edges"] == "arêtes"
    _, path = written(tmp_path, language="ANGL")
    assert '<html lang="en">' in path.read_text(encoding="utf-8")
    assert data_of(path)["words"] == {}


# ---------------------------------------------------------------- in a browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if find_browser() is None:
        pytest.skip("NO CHROMIUM HERE: THE REPORT IS NOT TESTED IN A BROWSER (apt install chromium)")
    driven = Browser(tmp_path_factory.mktemp("profile"))
    yield driven
    driven.close()


@pytest.fixture
def page(browser, tmp_path):
    """The browser on a fresh report; at the end nothing may have been complained about or fetched."""
    session, path = written(tmp_path)
    browser.complaints.clear()
    browser.requests.clear()
    browser.open(path, f"location.pathname.startsWith('{tmp_path.as_posix()}') && gibiane.data !== null")
    browser.session, browser.path = session, path
    yield browser
    assert browser.value("gibiane.errors") == []
    assert browser.complaints == []
    assert {url.partition(":")[0] for url in browser.requests} <= {"file", "data"}


def test_tabs_show_one_page_at_a_time(page):
    shown = "[...document.querySelectorAll('section')].map((s) => !s.hidden)"
    assert page.value("[...document.querySelectorAll('nav button')].map((b) => b.textContent)") == [
        "Words & numbers",
        "Cost",
        "Views",
        "Environment",
    ]
    for k in (2, 0, 3, 1):
        page.value(f"document.querySelectorAll('nav button')[{k}].click()")
        assert page.value(shown) == [i == k for i in range(4)]
    assert page.value("document.querySelector('section p').textContent") == "not </script> the end"


def test_a_click_on_a_heading_sorts_a_table(page):
    first = "document.querySelector('tbody td').textContent"
    assert page.value(first) == "T1"
    page.value("document.querySelectorAll('th')[1].click()")
    assert page.value(first) == "T2"


def test_a_chart_has_its_points_its_front_and_its_records(page):
    page.value("gibiane.open(1)")
    assert page.value("document.querySelectorAll('.chart [data-point]').length") == 7
    caption = page.value("document.querySelectorAll('section')[1].querySelector('.caption').textContent")
    assert caption == "Pareto front (dashed), by increasing abscissa: CUB8 – CU20, adaptive"
    place = page.value(
        '(() => { const b = document.querySelector(\'[data-curve="0"][data-point="3"]\').getBoundingClientRect();'
        " return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    page.mouse("mouseMoved", *place)
    page.wait("document.querySelector('.tip') && !document.querySelector('.tip').hidden")
    assert page.value("document.querySelector('.tip').textContent").split("\n") == [
        "CUB8",
        "time (s): 60",
        "error (%): 2.6",
        "date: 2026-11-28",
        "numpy: 2.4.6",
        "runs: 3",
    ]


def test_a_chart_is_zoomed_by_dragging_and_comes_back(page):
    page.value("gibiane.open(1)")
    box = page.value(
        "(() => { const b = document.querySelector('.chart svg').getBoundingClientRect(); return [b.x, b.y]; })()"
    )
    before = page.value("gibiane.charts.cost.range")
    page.drag((box[0] + 300, box[1] + 100), (box[0] + 600, box[1] + 300))
    after = page.value("gibiane.charts.cost.range")
    assert before["x"][0] < after["x"][0] < after["x"][1] < before["x"][1]
    assert before["y"][0] < after["y"][0] < after["y"][1] < before["y"][1]
    page.value("document.querySelector('.chart svg').dispatchEvent(new MouseEvent('dblclick'))")
    assert page.value("gibiane.charts.cost.range") == before


def test_axes_have_round_ticks_and_never_one_alone(page):
    """A short logarithmic range holds no power of ten and perhaps one of 1, 2, 5."""

    def labels(log, low, high, length=400):
        return page.value(
            f"new Axis({str(log).lower()}, {low}, {high}, {length}, 0).ticks(26).map((t) => t[1]).filter(Boolean)"
        )

    assert labels(True, 22, 48) == ["25", "30", "35", "40", "45"]
    assert labels(True, 0.7, 60) == ["1", "2", "5", "10", "20", "50"]
    assert labels(True, 1, 2e4) == ["1", "10", "100", "1000", "10000"]
    assert labels(False, 0, 9, 120) == ["0.0", "2.5", "5.0", "7.5"]
    for low in (0.011, 1.1, 37.0, 4.4e5):
        for factor in (1.02, 1.5, 2.5, 7.0, 40.0, 1e4, 1e12, 1e30):
            shown = labels(True, low, low * factor)
            assert 3 <= len(shown) <= 16, (low, factor, shown)
            assert len(set(shown)) == len(shown)


def test_thirty_curves_are_told_apart_and_named_whole(page):
    look = page.value(
        "(() => { const curves = Array.from({length: 30}, (_, k) => ({name: `CUB8, quarter, surface to surface ${k}`,"
        " color: '', line: true, dash: false, x: [1, 2], y: [k, k + 1], notes: []}));"
        " const chart = new Chart({id: 'many', title: '', curves, xtitle: 'x', ytitle: 'y', xlog: false, ylog: false});"
        " const looks = chart.style.map((s) => JSON.stringify(s));"
        " const names = [...chart.legend.children].map((e) => e.textContent);"
        " delete gibiane.charts.many; return [new Set(looks).size, names]; })()"
    )
    assert look == [30, [f"CUB8, quarter, surface to surface {k}" for k in range(30)]]


def test_numbers_of_a_column_have_as_many_decimals(page):
    shown = page.value(
        "(() => { const node = BLOCKS.table({head: ['mu', 'error', 'St', 'n', 'word'],"
        " rows: [[0.01, 53.94881, 1e-5, 520, ''], [0.5, 8.8, 0.01, 33280, '8.80'], [0.2, 0.0001234, 0, 16, 'glued']]});"
        " const texts = (r) => [...r.children].map((c) => c.textContent);"
        " const read = () => [...node.querySelectorAll('tbody tr')].map(texts);"
        " const first = read(); node.querySelectorAll('th')[4].click(); return [first, read().map((r) => r[4])]; })()"
    )
    assert shown[0] == [
        ["0.01", "53.95", "1e-5", "520", ""],
        ["0.50", "8.80", "0.01", "33280", "8.80"],
        ["0.20", "1.2e-4", "0", "16", "glued"],
    ]
    assert shown[1] == ["8.80", "", "glued"]


def test_the_wheel_scrolls_the_page_until_a_chart_is_clicked(page):
    page.value("gibiane.open(1)")
    box = page.value(
        "(() => { const b = document.querySelector('.chart svg').getBoundingClientRect(); return [b.x, b.y]; })()"
    )
    before = page.value("gibiane.charts.cost.range")
    wheel = {"x": box[0] + 300, "y": box[1] + 100, "deltaX": 0, "deltaY": -100}
    page.mouse("mouseWheel", **wheel)
    assert page.value("gibiane.charts.cost.range") == before
    page.drag((wheel["x"], wheel["y"]), (wheel["x"], wheel["y"]))
    page.mouse("mouseWheel", **wheel)
    page.wait(f"gibiane.charts.cost.range.x[0] > {before['x'][0]}")


def test_a_phone_has_letters_of_the_same_size_and_no_sideways_scroll(page):
    try:
        page.call("Emulation.setDeviceMetricsOverride", width=390, height=800, deviceScaleFactor=2, mobile=True)
        for k in range(4):
            page.value(f"gibiane.open({k})")
            page.wait("document.documentElement.scrollWidth <= 390")
        page.value("gibiane.open(1)")
        page.wait("gibiane.charts.cost.width < 390")
        ratio = page.value("gibiane.charts.cost.svg.getBoundingClientRect().width / gibiane.charts.cost.width")
        assert ratio == pytest.approx(1.0, abs=0.02)
    finally:
        page.call("Emulation.clearDeviceMetricsOverride")


def test_in_the_dark_papers_and_inks_change(page):
    page.value("gibiane.open(2)")
    page.wait("gibiane.views.block.camera.width > 100")
    light = pixels(page)
    try:
        page.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}])
        page.wait("theme.dark")
        dark = pixels(page)
        ink, paper = (page.value(f"getComputedStyle(document.body).{k}") for k in ("color", "backgroundColor"))
    finally:
        page.call("Emulation.setEmulatedMedia", features=[])
    assert light[0, -1].min() > 0.99
    assert dark[0, -1].max() < 0.2
    assert [sum(map(int, re.findall(r"\d+", c)[:3])) for c in (ink, paper)] == [
        pytest.approx(690, abs=80),
        pytest.approx(77, abs=40),
    ]


def test_a_printed_report_has_every_page_and_its_views(page):
    inside = "[...document.querySelectorAll('section')].map((s) => s.children.length)"
    assert page.value(inside)[1:] == [1, 1, 1]
    # what is there when it is printed, for the file itself cannot be read without a further package
    page.value(
        "window.addEventListener('beforeprint', () => { gibiane.printed = "
        "[[...document.querySelectorAll('section')].map((s) => s.hidden), gibiane.views.block.over.toDataURL()]; })"
    )
    page.call("Page.printToPDF")
    shown, drawn = page.value("gibiane.printed")
    assert shown == [False] * 4
    assert min(page.value(inside)) >= 2
    assert (picture(drawn)[..., :3].min(axis=2) < 0.97).mean() > 0.05
    assert page.value("[...document.querySelectorAll('section')].map((s) => s.hidden)") == [False, True, True, True]


def test_buttons_and_hints_are_in_french_where_the_session_is(page, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    _, path = written(other, language="FRAN")
    page.open(path, f"location.pathname.startsWith('{other.as_posix()}') && gibiane.data !== null")
    page.value("gibiane.open(2)")
    page.wait("gibiane.views.block.camera.width > 100")
    bar = page.value("document.querySelector('.tools').textContent")
    assert "voir à travers" in bar
    assert "déplacements" in bar
    assert not re.search("edges|fit|drag", bar)
    assert "sur le front de Pareto" in page.value("(gibiane.open(1), gibiane.charts.cost.record(1, 2))")


def test_one_changed_measure_moves_its_point_and_the_front(page, tmp_path):
    """The chart is drawn from the numbers of the script: 60 s becomes 4 s, and that point beats two others."""

    def seen():
        return page.value(
            "gibiane.open(1) ?? [[...document.querySelectorAll('.chart [data-point]')]"
            ".map((c) => c.getBoundingClientRect()).map((b) => b.x + b.width / 2), gibiane.charts.cost.block.pareto]"
        )

    places, front = seen()
    other = tmp_path / "other"
    other.mkdir()
    _, path = written(other, time="4.")
    page.open(path, f"location.pathname.startsWith('{other.as_posix()}') && gibiane.data !== null")
    moved, beaten = seen()
    assert moved[3] < places[3] - 100
    assert [0, 3] not in front
    assert [0, 3] in beaten
    assert [1, 1] in front
    assert [1, 1] not in beaten


def test_a_view_turns_and_gives_back_computed_values(page):
    page.value("gibiane.open(2)")
    page.wait("gibiane.views.block.camera.width > 100")
    assert page.value("gibiane.views.block.drawnBy") in ("webgl2", "canvas")
    box = page.value("(() => { const b = gibiane.views.block.stage.getBoundingClientRect(); return [b.x, b.y]; })()")
    size = page.value("[gibiane.views.block.camera.width, gibiane.views.block.camera.height]")
    middle = (size[0] / 2, size[1] / 2)

    picked = page.value(f"gibiane.views.block.pick({middle[0]}, {middle[1]})")
    assert picked["field"] == "U UX"
    assert picked["atNode"] == at_node(page.session, "UX", picked["node"])
    assert page.value(f"gibiane.views.block.atNode({picked['node']}, 'U UZ')") == at_node(
        page.session, "UZ", picked["node"]
    )
    zone = page.session.globals.names["CARTE"].zones[0]
    number = picked["element"]
    assert page.value(f"gibiane.views.block.atElement({number}, 'error map')") == float(
        zone.component("SCAL")[number - 1].mean()
    )

    page.mouse("mouseMoved", box[0] + middle[0], box[1] + middle[1])
    page.wait("!document.querySelector('.tip').hidden")
    assert f"node {picked['node']} " in page.value("document.querySelector('.tip').textContent")

    before = page.value("gibiane.views.block.canvas.toDataURL()")
    angle = page.value("gibiane.views.block.camera.yaw")
    page.drag((box[0] + 200, box[1] + 200), (box[0] + 300, box[1] + 200))
    assert page.value("gibiane.views.block.camera.yaw") == pytest.approx(angle - 40.0)
    after = page.value("gibiane.views.block.canvas.toDataURL()")
    assert after != before


def picture(url):
    """Read the picture of a data URL: (height, width, 4)."""
    import io

    import matplotlib.image

    return matplotlib.image.imread(io.BytesIO(base64.b64decode(url.partition(",")[2])))


def pixels(page, name="block"):
    """Read the canvas of a view: (height, width, 3), from the picture that it gives."""
    return picture(page.value(f"gibiane.views['{name}'].canvas.toDataURL()"))[..., :3]


def test_a_view_is_painted_in_the_colours_of_its_legend_with_its_arrows(page):
    page.value("gibiane.open(2)")
    page.wait("gibiane.views.block.camera.width > 100")
    page.value("gibiane.views.block.show(3)")
    image = pixels(page)
    drawn = (image.min(axis=2) < 0.97).mean()
    assert 0.05 < drawn < 0.8
    # halfway along the longest arrow the red of the arrows, lit or in the shade
    column, row, width = page.value(
        "(() => { const v = gibiane.views.block, a = v.arrows[0], f = v.factor; let best = 0, far = -1;"
        " for (let i = 0; i < a.vectors.length; i += 3) { const d = Math.hypot(...a.vectors.subarray(i, i + 3));"
        " if (d > far) { far = d; best = i; } }"
        " const at = [0, 1, 2].map((k) => a.points[best + k] + f * a.moved[best + k]"
        " + 0.5 * a.scale * a.vectors[best + k] - v.centre[k]);"
        " return [...v.camera.see(...at).slice(0, 2), v.camera.width]; })()"
    )
    ratio = image.shape[1] / width
    seen = image[int(row * ratio), int(column * ratio)]
    red = np.array([0xC0, 0x39, 0x2B]) / 255
    shade = float(seen @ red / (red @ red))
    assert 0.6 < shade < 1.05
    np.testing.assert_allclose(seen, shade * red, atol=0.05)
    page.value("[...document.querySelectorAll('.tools label')].find((l) => l.textContent === 'see through').click()")
    glassy = pixels(page)
    covered = image.min(axis=2) < 0.97
    assert glassy[covered].mean() > image[covered].mean() + 0.1
    limits = page.value("gibiane.views.block.limits")
    values = page.session.globals.names["CARTE"].zones[0].component("SCAL")
    assert limits[0] <= values.min()
    assert limits[-1] >= values.max()


def test_without_webgl_a_plain_canvas_shows_the_same_view(tmp_path):
    if find_browser() is None:
        pytest.skip("NO CHROMIUM HERE: THE REPORT IS NOT TESTED IN A BROWSER (apt install chromium)")
    _, path = written(tmp_path)
    images = []
    for webgl in (True, False):
        driven = Browser(tmp_path / f"profile{webgl}", webgl=webgl)
        try:
            driven.open(path, "gibiane.data !== null")
            driven.value("gibiane.open(2)")
            driven.wait("gibiane.views.block.camera.width > 100")
            assert driven.value("gibiane.views.block.drawnBy") == ("webgl2" if webgl else "canvas")
            images.append(pixels(driven))
        finally:
            driven.close()
    covered = [image.min(axis=2) < 0.97 for image in images]
    assert (covered[0] & covered[1]).sum() > 0.9 * (covered[0] | covered[1]).sum()
    both = covered[0] & covered[1]
    assert np.abs(images[0][both] - images[1][both]).mean() < 0.15
