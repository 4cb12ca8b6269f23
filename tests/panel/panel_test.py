#!/usr/bin/python3
"""Tests the panel as people use it: the program on a JACK server, its page in Chromium.

  panel_test.py PROGRAM FOLDER [pictures FOLDER [MODEL...]]

FOLDER is the checkout. With `pictures` it takes screenshots instead, of the models that follow.
"""
import http.client
import math
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from browser import Browser  # noqa: E402

SERVER = "ressort-panel"
PATIENCE_S = 30  # only a program that hangs takes longer
failures = 0


def check(holds, what):
    global failures
    print(("ok      " if holds else "FAILED  ") + what, flush=True)
    failures += 0 if holds else 1
    return holds


def eventually(holds, seconds=PATIENCE_S):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.05)
    return False


class Program:
    """`ressort play` and the address that it prints."""

    def __init__(self, program, model, *more, audio="jack"):
        self.lines = []
        self.child = subprocess.Popen(
            [program, "play", model, "-a", audio, "-m", "none", "-u", "off", "--web", "9790", *more],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        threading.Thread(target=self.read, daemon=True).start()
        if not eventually(lambda: self.said(r"^panel: ")):
            raise RuntimeError("no panel: " + "".join(self.lines))
        line = next(line for line in self.lines if line.startswith("panel: "))
        self.address = line.split()[1]
        self.port = int(re.search(r":(\d+)/", self.address).group(1))

    def read(self):
        for line in self.child.stdout:
            self.lines.append(line)

    def said(self, pattern):
        return any(re.search(pattern, line) for line in self.lines)

    def type(self, text):
        self.child.stdin.write(text + "\n")
        self.child.stdin.flush()

    def request(self, method, path, body=None, headers=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        text = answer.read()
        connection.close()
        return answer.status, text

    def osc(self, address, *values):
        pad = lambda text: text.encode() + b"\0" * (4 - len(text.encode()) % 4)
        packet = pad(address) + pad("," + "f" * len(values)) + b"".join(
            struct.pack(">f", value) for value in values)
        return self.request("POST", "/osc", packet, {"Content-Type": "application/octet-stream"})

    def parameter(self, name):
        answer = self.osc("/param/" + name)[1]
        return struct.unpack(">f", answer[-4:])[0]

    def control(self, name):
        answer = self.osc("/control/" + name)[1]
        return struct.unpack(">f", answer[-4:])[0]

    def close(self):
        self.child.send_signal(signal.SIGTERM)
        try:
            return self.child.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.child.kill()
            return -1


class Frames:
    """The frames that /motion sends, received in a thread."""

    def __init__(self, port, hz=30):
        self.frames = []  # (samples played, picture, positions as bytes)
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.socket.sendall(f"GET /motion?hz={hz} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n"
                            .encode())
        self.answer = http.client.HTTPResponse(self.socket)
        self.answer.begin()
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        try:
            while head := self.answer.read(24):
                frame, picture, dots, samples, _ = struct.unpack("<QIIII", head)
                data = self.answer.read(4 * (dots + samples))
                self.frames.append((frame, picture, data[:4 * dots]))
        except (OSError, ValueError, http.client.HTTPException, struct.error):
            pass

    def close(self):
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.socket.close()


def frame_rate(program, seconds):
    """Checks for 25 frames of 598 masses per second of sound, by the sample counts in the frames."""
    _, text = program.request("GET", "/describe")
    frames = Frames(program.port)
    rate = 48000
    eventually(lambda: frames.frames and
               frames.frames[-1][0] - frames.frames[0][0] >= seconds * rate, 6 * seconds)
    frames.close()
    got = [frame for frame in frames.frames if frame[0] - frames.frames[0][0] <= seconds * rate]
    played_s = (got[-1][0] - got[0][0]) / rate
    hz = (len(got) - 1) / played_s
    print(f"        {len(got)} frames of {len(got[0][2]) // 4} masses in {played_s:.2f} s of sound,"
          f" {hz:.1f} a second")
    check(len(got[0][2]) // 4 == 598 and hz >= 25.0, "25 frames a second of 598 masses")
    check(all(a[0] < b[0] for a, b in zip(got, got[1:])), "frames come in order, none twice")


def doors(program):
    for headers in ({"Host": "evil.com"}, {"Host": f"127.0.0.1.evil.com:{program.port}"},
                    {"Origin": "http://evil.com"}, {"Origin": "null"}):
        check(program.request("GET", "/describe", headers=headers)[0] == 403,
              f"403 for {headers}")


def silence(program, browser):
    # The status may be older than the panic, whose fade would take the next strike with it. Each frame
    # shows a later sample. A strike that is still on its way from the page comes after the first
    # panic and rings on.
    for _ in range(3):
        shown = browser.evaluate("panel.frames")
        program.osc("/panic")
        browser.eventually(f"panel.frames > {shown} + 4")
        if browser.eventually("(panel.status.peak_db ?? -999) < -80 && panel.status.voices === 0", 10):
            return True
    return False


def centre(browser, selector):
    return browser.evaluate(
        f"(() => {{ const b = document.querySelector('{selector}').getBoundingClientRect();"
        " return [b.x + b.width / 2, b.y + b.height / 2]; })()")


def plucks(program, browser):
    check(silence(program, browser), "the panel is silent at first")
    x, y = browser.evaluate(
        "(() => { const v = panel.view, n = v.net.inputs[0][1],"
        " b = v.canvas.getBoundingClientRect(); return [b.x + v.sx[n], b.y + v.sy[n]]; })()")
    browser.mouse("mouseMoved", x, y)
    check(browser.evaluate("document.getElementById('hint').textContent").startswith("input 1"),
          "the hint names the input under the pointer")
    browser.evaluate("globalThis.struck = 0; globalThis.most = 0; (function look() {"
                     " const v = panel.view, n = v.net.inputs[0][1];"
                     " for (let i = 0; i < v.net.dots; i++)"
                     "  if (!struck && Math.abs(v.positions[i] - v.net.start[i]) > 1e-5) struck = 1;"
                     " requestAnimationFrame(look); })()")
    browser.mouse("mousePressed", x, y)
    for step in range(1, 6):
        browser.mouse("mouseMoved", x, y - 16 * step)
    browser.mouse("mouseReleased", x, y - 80)
    check(browser.eventually("panel.status.peak_db > -60"), "a pluck on the picture is heard")
    check(browser.eventually("struck === 1"), "and seen")


# Two unconnected pendulums of two masses each; the inputs are at the first masses.
APART = """@g ground 0.
@low_a osc 1. 0.0009 0.0001 0. 0.
@low_b mass 1. 0. 0.
@low_s springDamper @low_a @low_b 0.02 0.0001
@high_a osc 1. 0.0081 0.0001 0. 0.
@high_b mass 1. 0. 0.
@high_s springDamper @high_a @high_b 0.18 0.0001
@in1 frcInput @low_a
@in2 frcInput @high_a
@out1 posOutput @low_b
@out1 posOutput @high_b
"""


# Two unconnected strings without an input.
STRUNG = """@low waveguide 1. 148.9 3. 0.2 0.
@high waveguide 1. 446.7 3. 0.2 0.
@out1 posOutput [@low 0.3]
@out1 posOutput [@high 0.3]
"""


def hint(browser):
    return browser.evaluate("document.getElementById('hint').textContent")


def on_picture(browser, name):
    """Moves the pointer to a mass, once its position in the picture is steady."""
    x = y = None
    for _ in range(50):
        x, y = browser.evaluate(
            f"(() => {{ const v = panel.view, n = v.net.names.indexOf('{name}'),"
            " b = v.canvas.getBoundingClientRect(); return [b.x + v.sx[n], b.y + v.sy[n]]; })()")
        if x is not None and y is not None:
            browser.mouse("mouseMoved", x, y)
            if hint(browser).startswith(name):
                break
        time.sleep(0.1)
    return x, y


def click(browser, x, y):
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x, y - 60)
    browser.mouse("mouseReleased", x, y - 60)


def heard(browser):
    """Returns the amplitudes at 149 and 447 Hz of the loudest of six windows of the sound."""
    return browser.evaluate("""new Promise(done => {
      let most = [0, 0], shown = panel.frames, left = 6;
      const until = performance.now() + 10000;
      (function look() {
        if (panel.frames !== shown) {
          shown = panel.frames;
          --left;
          const now = [148.9, 446.7].map(hz => {
            const y = panel.heard, w = 2 * Math.PI * hz / 48000;
            let re = 0, im = 0;
            y.forEach((v, n) => {
              const hann = 0.5 - 0.5 * Math.cos(2 * Math.PI * n / y.length);
              re += hann * v * Math.cos(w * n); im += hann * v * Math.sin(w * n);
            });
            return Math.hypot(re, im);
          });
          if (now[0] + now[1] > most[0] + most[1]) most = now;
        }
        if (left > 0 && performance.now() < until) requestAnimationFrame(look); else done(most);
      })();
    })""")


def strikes(program, browser, names):
    """Strikes masses without an input on the picture and compares the pitches: 149 and 447 Hz."""
    tones = {}
    for name, hz in zip(names, (149, 447)):
        check(silence(program, browser), f"silence before {name} is struck")
        x, y = on_picture(browser, name)
        check(hint(browser).startswith(name), f"the hint says that a click strikes {name}")
        click(browser, x, y)
        check(browser.eventually("panel.status.peak_db > -60"), f"{name} is heard")
        if "_" in name:  # a pendulum has few other frequencies
            check(browser.eventually(f"Math.abs(panel.status.centroid_hz - {hz}) < 30"),
                  f"the centroid is that of {name}")
        # Both masses together vibrate at sqrt(K/2) per sample, 44 100 of them a second: 149 and 447 Hz.
        # The loudest of the next windows is compared: the first may hold the end of the silence, and
        # on a slow machine the tone may have decayed in the last.
        for _ in range(3):  # Strikes again if the tone had decayed before the first window.
            tones[name] = heard(browser)
            if sum(tones[name]) > 0:
                break
            click(browser, x, y)
    print("        " + str(tones))
    low, high = (tones[name] for name in names)
    check(low[0] > 10 * low[1], "the low one is heard at 149 Hz")
    check(high[1] > 10 * high[0], "the high one is heard at 447 Hz")


def swings(browser):
    """A waveguide is drawn as a line of points, which its waves move."""
    check(browser.evaluate("[...panel.view.net.kinds].filter(k => k === 'w').length") == 66,
          "each string is drawn as points")
    check(browser.evaluate("""new Promise(done => {
      const v = panel.view, most = [], until = performance.now() + 5000;
      (function look() {
        [...v.net.kinds].forEach((kind, i) => {
          if (kind === 'w') most[i] = Math.max(most[i] ?? 0, Math.abs(v.positions[i] - v.net.start[i]));
        });
        const points = most.filter(m => m !== undefined).slice(34, 65);
        if (points.every(m => m > 0.01 * Math.max(...points)) || performance.now() > until)
          done(Math.max(...points) > 0 && points.every(m => m > 0.01 * Math.max(...points)));
        else requestAnimationFrame(look);
      })();
    })"""), "all points of the string that was struck have moved")


# A string of an odd number of masses, plucked at the middle one.
MIDDLE = """@s string 31 1. 0.1 0.0002 0. 0.
@in1 frcInput [@s 0.5]
@out1 posOutput [@s 0.5]
"""


def mirrors(program, browser):
    """A symmetrical pluck moves the picture symmetrically, to a thousandth of a pixel."""
    picture = "panel.view.canvas.toDataURL()"
    check(silence(program, browser), "silence before the pluck")
    browser.eventually("panel.view.positions.every((x, i) => Math.abs(x - panel.view.net.start[i]) < 1e-4 * panel.view.peak)", 5)
    before = browser.evaluate(picture)
    x, y = browser.evaluate(
        "(() => { const v = panel.view, n = v.net.inputs[0][1],"
        " b = v.canvas.getBoundingClientRect(); return [b.x + v.sx[n], b.y + v.sy[n]]; })()")
    browser.mouse("mouseMoved", x, y)
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x, y - 60)
    browser.mouse("mouseReleased", x, y - 60)
    found = browser.evaluate("""new Promise(done => {
      const v = panel.view, middle = v.width / 2;
      let apart = 0, most = 0, looks = 0;
      const until = performance.now() + 10000;  // the first frames may be late
      (function look() {
        const line = [...v.net.kinds].map((kind, i) => [v.sx[i], v.sy[i], v.flat[i][1]])
          .sort((a, b) => a[0] - b[0]);
        line.forEach(([px, py, at], i) => {
          const [qx, qy] = line[line.length - 1 - i];
          apart = Math.max(apart, Math.abs(px - middle + qx - middle), Math.abs(py - qy));
          most = Math.max(most, Math.abs(py - at));
        });
        if ((++looks < 120 || most <= 20) && performance.now() < until) requestAnimationFrame(look);
        else done([apart, most]);
      })();
    })""")
    print(f"        {found[1]:.1f} pixels high, {found[0]:.5f} pixels from its mirror image")
    check(found[1] > 20, "the picture moves")
    check(found[0] < 0.01, "the picture moves symmetrically")
    check(browser.evaluate(picture) != before, "the canvas has changed")
    keeps_its_width(browser)


def keeps_its_width(browser):
    """News that make the page longer than the window do not make the picture narrower."""
    width = browser.evaluate("panel.view.width")
    longer = browser.evaluate("""new Promise(done => {
      for (let i = 0; i < 12; i++)
        document.getElementById('news').append(Object.assign(document.createElement('li'), { textContent: 'news' }));
      const page = document.documentElement;
      setTimeout(() => done(page.scrollHeight > page.clientHeight), 500);
    })""")
    check(longer, "twelve news make the page longer than the window")
    check(browser.evaluate("panel.view.width") == width, "the picture keeps its width")


def keys(program, browser):
    check(silence(program, browser), "silence at once")
    browser.evaluate("document.getElementById('network').focus()")
    browser.key("ArrowRight", "ArrowRight")
    browser.key("Enter", "Enter", "\r")
    check(browser.eventually("panel.status.peak_db > -60"), "an input can be played with keys only")
    check(silence(program, browser), "silence again")
    before = browser.evaluate("panel.status.notes")
    browser.key("a", "KeyA", "a")
    check(browser.eventually(f"panel.status.notes === {before} + 1"), "a letter plays a note")
    before = browser.evaluate("panel.status.notes")
    browser.mouse("mousePressed", *centre(browser, "#keyboard [data-key=\"60\"]"))
    browser.mouse("mouseReleased", *centre(browser, "#keyboard [data-key=\"60\"]"))
    check(browser.eventually(f"panel.status.notes === {before} + 1"), "a piano key plays a note")
    # Every control can be reached by Tab, and has a name.
    names = browser.evaluate(
        "[...document.querySelectorAll('button, input, canvas[tabindex]')]"
        ".filter(e => !(e.getAttribute('aria-label') || e.textContent.trim() ||"
        " document.querySelector(`label[for='${e.id}']`)?.textContent)).map(e => e.outerHTML)")
    check(names == [], f"every control has a name {names or ''}")


def slides(program, browser):
    start = program.parameter("mesh_Z")
    browser.evaluate("document.getElementById('p-mesh_Z').focus()")
    for _ in range(12):
        browser.key("ArrowRight", "ArrowRight")
    check(eventually(lambda: program.parameter("mesh_Z") > start * 1.01),
          "a slider sets its parameter")

    # The page sends changes with a delay, so wait until all have arrived before the next change.
    def has_settled():
        before = program.parameter("mesh_Z")
        time.sleep(0.5)
        return program.parameter("mesh_Z") == before
    eventually(has_settled)
    program.osc("/param/mesh_Z", 0.03)
    check(browser.eventually(
        "document.querySelector('label[for=\"p-mesh_Z\"] + output').textContent === '0.03'"),
        "a parameter set by another client moves the slider")
    at = float(browser.evaluate("document.getElementById('p-mesh_Z').value"))
    program.type("set mesh_Z 0.0001")
    check(browser.eventually(f"+document.getElementById('p-mesh_Z').value < {at}"),
          "a parameter set at the console moves the slider")


def turns(program, browser):
    """Turns the knobs by keys and pointer, and from outside."""
    names = browser.evaluate(
        "[...document.querySelectorAll('[role=slider]')].map(d => d.getAttribute('aria-label'))")
    check(names == ["Brightness", "Ring", "Touch", "Damping"], f"the knobs have names {names}")
    program.osc("/control/touch", 0.5)
    shown = "+document.querySelector('.dial[aria-label=\"Touch\"]').getAttribute('aria-valuenow')"
    check(browser.eventually(shown + " === 50"), "a knob follows another client")
    browser.evaluate("document.querySelector('.dial[aria-label=\"Touch\"]').focus()")
    for _ in range(10):
        browser.key("ArrowUp", "ArrowUp")
    check(eventually(lambda: abs(program.control("touch") - 0.6) < 1e-6), "arrow keys turn a knob")
    browser.key("Home", "Home")
    check(eventually(lambda: program.control("touch") == 0.0), "Home turns it to its start")
    browser.evaluate("document.querySelector('.dial[aria-label=\"Touch\"]').scrollIntoView({block: 'center'})")
    x, y = centre(browser, '.dial[aria-label="Touch"]')
    browser.mouse("mouseMoved", x, y)
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x, y - 50)
    browser.mouse("mouseReleased", x, y - 50)
    check(eventually(lambda: abs(program.control("touch") - 0.25) < 1e-6),
          "a drag of 200 pixels is the whole range")
    program.type("set touch 1")
    check(browser.eventually(shown + " === 100"), "a knob follows its parameter")


def shows_modes(browser):
    browser.evaluate("document.getElementById('find-modes').click()")
    check(browser.eventually("document.querySelectorAll('#modes button').length === 24"),
          "the page lists the modes")
    browser.evaluate("document.querySelector('#modes button').click()")
    check(browser.evaluate("panel.view.mode.length === panel.view.net.x.length"),
          "a click shows a mode's shape")
    check(browser.evaluate("document.querySelector('#modes button').textContent")
          .startswith("99.29 Hz"), "the first mode is the one that `ressort check` prints, 99.29 Hz")
    browser.evaluate("document.querySelector('#modes button').click()")


# A bell with two modes and three places, and a string with eight partials.
BELL = """@bell body 1. clapper left right
@b1 mode @bell 200. 3. 1. 0.5 -0.5
@b2 mode @bell 500. 3. 0.2 -0.8 0.4
@s modalString 8 1. 300. 0. 1. 0. 0.
@in1 frcInput [@bell clapper]
@in2 frcInput [@s 0.25]
@out1 posOutput [@bell left]
@out1 posOutput [@s 0.25]
"""


def shows_bodies(program, browser):
    """A bell is a ring with named places, and a string is a line. Both move as their modes do."""
    check(browser.evaluate("""(() => { const f = panel.view.net.figures[0];
      return f.form.isRing && f.names.join() === 'clapper,left,right' && f.nodes.every(n =>
        Math.abs(Math.hypot((panel.view.flat[n][0] - f.x) / f.rx, (panel.view.flat[n][1] - f.y) / f.ry) - 1) < 1e-9); })()"""),
          "the places of a bell are on a ring")
    browser.eventually("document.querySelector('#sliders p')")
    browser.evaluate("document.getElementById('find-modes').click()")
    browser.eventually("document.querySelectorAll('#modes button').length > 3")
    shapes = browser.evaluate("""(() => { const { view } = panel, { net } = view, line = [];
      [...net.kinds].forEach((kind, i) => { if (kind === 'w' && !net.figures[0].nodes.includes(i)) line.push(i); });
      const moved = hz => {
        const button = [...document.querySelectorAll('#modes button')].find(b => b.textContent.startsWith(hz + ' Hz'));
        button.click();
        const of = nodes => nodes.map(node => view.mode[node]), both = [of(net.figures[0].nodes), of(line)];
        button.click();
        return both;
      };
      return [moved('200.0'), moved('500.0'), moved('600.0')]; })()""")
    for (bell, string), shape in zip(shapes, ((1, 0.5, -0.5), (0.2, -0.8, 0.4), None)):
        if shape:
            check(all(abs(a / bell[1] - b / shape[1]) < 1e-6 for a, b in zip(bell, shape)),
                  f"a mode moves the places of the bell by {shape}")
        else:
            sine = [math.sin(2 * math.pi * i / 48) for i in range(49)]
            check(max(abs(a - b * string[12]) for a, b in zip(string, sine)) < 1e-6
                  and abs(string[12]) > 0.1, "the second partial moves the string as a whole sine")
    x, y = on_picture(browser, "bell:left")
    check(hint(browser).startswith("bell:left"), "the hint says that a click strikes bell:left")
    click(browser, x, y)
    check(browser.eventually("panel.status.peak_db > -60"), "and it sounds")
    at = "(name => { const v = panel.view, i = v.net.names.indexOf(name); return v.positions[i] - v.net.start[i]; })"
    browser.eventually(f"Math.abs({at}('bell:1')) > 1e-3")
    first, second, left = browser.evaluate(f"['bell:1', 'bell:2', 'bell:left'].map({at})")
    check(0 < abs(first) and abs(0.5 * first - 0.8 * second - left) < 1e-5 * abs(first),
          "the place has moved by its share of each mode")


def falls(program, browser):
    """The spectrogram shows the pitch of a tone, and moves by a tenth of its width in a second."""
    look = """(() => { const s = panel.spectrogram, { width, height } = s.past.canvas;
      const row = Math.floor(height * (1 - Math.log(200 / 30) / Math.log(panel.status.rate / 60)));
      const ink = (x, y) => { const p = s.past.getImageData(x, y, 1, 1).data, q = s.past.getImageData(0, 0, 1, 1).data;
        return Math.abs(p[0] - q[0]) + Math.abs(p[1] - q[1]) + Math.abs(p[2] - q[2]); };
      let first = 0, best = 0;
      while (first < width && ink(first, row) < 60) first++;
      for (let y = 0; y < height; y++) if (ink(width - 2, y) > ink(width - 2, best)) best = y;
      return [first / width, s.time, 30 * (panel.status.rate / 60) ** (1 - (best + 0.5) / height)]; })()"""
    for _ in range(3):  # A busy machine may show the tone late.
        silence(program, browser)
        time.sleep(1.0)
        program.osc("/mass/bell:clapper/strike", 0.9)
        browser.eventually("panel.status.peak_db > -60")
        time.sleep(0.5)
        first, begin, hz = browser.evaluate(look)
        time.sleep(2.0)
        then, end, _ = browser.evaluate(look)
        if 0 < then < first < 1:
            break
    print(f"        {hz:.0f} Hz, from {first:.3f} to {then:.3f} of the width in {end - begin:.2f} s")
    # A bin of the spectrum is 23 Hz wide, a row of the picture 6 %.
    check(abs(math.log(hz / 200)) < 0.12, "the brightest row is at the pitch of the bell, 200 Hz")
    check(abs((first - then) * 10 - (end - begin)) < 0.1, "the picture moves at a tenth a second")
    show = "document.querySelector('.sound').style.display = "
    browser.evaluate(show + "'none'")
    hidden, frames = browser.evaluate("[panel.spectrogram.time, panel.frames]")
    browser.eventually(f"panel.frames > {frames} + 30")
    check(browser.evaluate("panel.spectrogram.time") == hidden, "it rests while it is not seen")
    browser.evaluate(show + "''")
    check(browser.eventually(f"panel.spectrogram.time > {hidden} + 0.5"), "and goes on when it is")


def learns(program, browser):
    """The knobs show the controllers that move them, and learn and forget them by a button."""
    desk = lambda n: f".knob:nth-child({n}) .desk small"
    button = lambda n: f".knob:nth-child({n}) .desk button"
    check(browser.eventually(f"document.querySelector('{desk(1)}').textContent ==="
                             " 'CC 20, relative; CC 74'"), "a knob shows its controllers")
    browser.evaluate(f"document.querySelector('{button(2)}').focus()")
    browser.key("Enter", "Enter", "\r")
    check(browser.eventually(f"document.querySelector('{desk(2)}').textContent ==="
                             " 'move a knob\u2026'"), "a key on its button makes it wait for a knob")
    browser.evaluate(f"document.querySelector('{button(2)}').click()")
    check(browser.eventually(f"document.querySelector('{desk(2)}').textContent === 'CC 71'"),
          "a click ends that")
    browser.evaluate(f"document.querySelector('{button(2)}').click()")
    browser.eventually(f"document.querySelector('{button(2)}').textContent === 'Cancel'")
    program.osc("/cc", 21, 64)
    check(browser.eventually(f"document.querySelector('{desk(2)}').textContent ==="
                             " 'learnt: CC 21; CC 71'"), "the controller that moves is assigned")
    program.osc("/cc", 21, 127)
    check(eventually(lambda: program.control("ring") == 1.0), "and moves the knob")
    browser.evaluate(f"document.querySelector('{button(2)}').click()")
    check(browser.eventually(f"document.querySelector('{desk(2)}').textContent === 'CC 71'"),
          "and is forgotten")


def slows_down(program, browser):
    """Prints how far a mass moves from one frame to the next in slow motion."""
    program.osc("/note/on", 57, 110)
    browser.evaluate("document.getElementById('slow').click()")
    browser.eventually("panel.view.net && panel.status.voices > 0")
    jumps = browser.evaluate("""new Promise(done => {
      const v = panel.view, seen = [];
      let last = panel.frames;
      (function look() {
        if (panel.frames !== last) { last = panel.frames; seen.push(v.positions[300] - v.net.start[300]); }
        if (seen.length < 90) requestAnimationFrame(look);
        else done(seen);
      })();
    })""")
    jumps = jumps[10:]
    most = max(abs(x) for x in jumps)
    steps = sorted(abs(a - b) / most for a, b in zip(jumps, jumps[1:]))
    print(f"        of the amplitude, {100 * steps[len(steps) // 2]:.0f} % from frame to frame")
    # The slow motion depends on the number of frames that a busy machine draws, so
    # tests/unit/panel/panel_test measures it.
    check(most > 0 and browser.evaluate(
        "document.getElementById('slow').getAttribute('aria-pressed') === 'true'"),
        "the picture moves in slow motion")
    browser.evaluate("document.getElementById('slow').click()")
    program.osc("/panic")


def loads(program, browser):
    browser.evaluate("document.getElementById('choose').click()")
    first = "document.querySelector('#scenes button').firstChild.textContent"
    browser.evaluate("document.querySelector('[aria-label=\"Favourite: Wind\"]').click()")
    browser.evaluate("document.getElementById('library').close()")
    browser.evaluate("document.getElementById('choose').click()")
    check(browser.evaluate(first) == "Wind", "a favourite comes first in the list")
    check(browser.evaluate("localStorage.getItem('favourites')") == '["Wind"]', "and is kept")
    browser.evaluate("[...document.querySelectorAll('#scenes button')]"
                     ".find(b => b.firstChild.textContent === 'BowedString').click()")
    check(browser.eventually("document.getElementById('name').textContent === 'BowedString' &&"
                             " panel.view.net.dots < 400 && !!document.getElementById('p-low_K')"),
          "another instrument is loaded from the list")
    program.osc("/note/on", 45, 100)
    check(browser.eventually("panel.status.peak_db > -60"), "and sounds")


def test(program_path):
    with tempfile.NamedTemporaryFile("w", suffix=".toml", delete=False) as file:
        file.write('[[controller]]\nfrom = "cc20"\nto = "brightness"\nmode = "twos-complement"\n')
    program = Program(program_path, "20x30mesh", "-z", "256", "--controllers", file.name)
    try:
        doors(program)
        with Browser() as browser:
            browser.open(program.address)
            if not check(browser.eventually("globalThis.panel && panel.view.net &&"
                                            " panel.view.net.dots === 598 && panel.frames > 5"),
                         "the page draws 598 masses"):
                print(browser.complaints(), program.lines)
                return
            frame_rate(program, float(os.environ.get("RESSORT_PANEL_SECONDS", "10")))
            plucks(program, browser)
            keys(program, browser)
            slides(program, browser)
            turns(program, browser)
            learns(program, browser)
            shows_modes(browser)
            slows_down(program, browser)
            loads(program, browser)
            check(browser.complaints() == [],
                  f"the browser reports no error {browser.complaints() or ''}")
    finally:
        os.remove(file.name)
        check(program.close() == 0, "the program ends normally while the page is open")
        if failures:
            print("the program said:\n" + "".join(program.lines))


def test_model(program_path, text, dots, look):
    with tempfile.TemporaryDirectory() as folder:
        model = os.path.join(folder, "model.mdl")
        with open(model, "w", encoding="utf-8") as file:
            file.write(text)
        program = Program(program_path, model)
        try:
            with Browser() as browser:
                browser.open(program.address)
                if check(browser.eventually("globalThis.panel && panel.view.net &&"
                                            f" panel.view.net.dots === {dots} && panel.frames > 5"),
                         f"the page draws {dots} dots"):
                    look(program, browser)
                check(browser.complaints() == [],
                      f"the browser reports no error {browser.complaints() or ''}")
        finally:
            check(program.close() == 0, "the program ends normally")


def test_strings(program, browser):
    strikes(program, browser, ("low:0.3", "high:0.3"))
    swings(browser)


def test_bodies(program, browser):
    shows_bodies(program, browser)
    falls(program, browser)


def pictures(program_path, folder, models):
    for model in models or ("20x30mesh", "BowedString"):
        for width, height in ((1280, 800), (390, 844)):
            for dark in (False, True):
                program = Program(program_path, model, audio="dummy")
                with Browser(width, height, dark, width < 500) as browser:
                    browser.open(program.address)
                    browser.eventually("globalThis.panel && panel.view.net && panel.frames > 5")
                    program.osc("/note/on", 45, 110)
                    time.sleep(1.2)
                    name = f"{os.path.basename(model)}-{width}{'-dark' if dark else ''}.png"
                    browser.screenshot(os.path.join(folder, name), whole=False)
                program.close()


def main():
    program = sys.argv[1]
    os.environ["RESSORT_DATA"] = sys.argv[2]
    if "pictures" in sys.argv:
        at = sys.argv.index("pictures")
        pictures(program, sys.argv[at + 1], sys.argv[at + 2:])
        return 0
    os.environ["JACK_DEFAULT_SERVER"] = SERVER
    os.environ["JACK_NO_START_SERVER"] = "1"
    os.environ["JACK_NO_AUDIO_RESERVATION"] = "1"
    jack = subprocess.Popen(["jackd", "-r", "-n", SERVER, "-d", "dummy", "-r", "48000", "-p", "256"],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        time.sleep(0.3)
        eventually(lambda: subprocess.run(["jack_lsp"], stdout=subprocess.DEVNULL,
                                          stderr=subprocess.DEVNULL).returncode == 0)
        test(program)
        test_model(program, APART, 4, lambda p, b: strikes(p, b, ("low_b", "high_b")))
        test_model(program, STRUNG, 2 + 66, test_strings)
        test_model(program, MIDDLE, 29, mirrors)
        test_model(program, BELL, 13, test_bodies)
    finally:
        jack.terminate()
        jack.wait()
    print(f"{failures} failed" if failures else "all passed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
