"""The browser fixtures themselves: they see what they must fail on, and 3D draws without a graphics card."""

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from threading import Thread

import pytest
from PIL import Image

from tests.browser.conftest import ConsoleWatch, OpenPage

PAGE = b"""<!doctype html><html lang="en"><title>t</title><p style="color:red">x</p><script>1</script>"""


class Strict(BaseHTTPRequestHandler):
    """Serves one page under the console's policy."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.send_header("Content-Security-Policy", "default-src 'self'")
        self.end_headers()
        self.wfile.write(PAGE)

    def log_message(self, format: str, *args: object) -> None:
        """Quiet."""


@pytest.fixture
def strict_url() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Strict) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


def test_a_policy_violation_is_seen(strict_url: str, open_page: OpenPage, console_watch: ConsoleWatch) -> None:
    open_page(strict_url)
    assert any("policy violation: style-src" in error for error in console_watch.unexpected())
    assert any("policy violation: script-src" in error for error in console_watch.unexpected())
    console_watch.expect("policy violation|Content Security Policy")
    assert console_watch.unexpected() == []


def test_a_console_error_and_an_uncaught_one_are_seen(open_page: OpenPage, console_watch: ConsoleWatch) -> None:
    page = open_page()
    page.evaluate("console.error('first')")
    page.evaluate("setTimeout(() => { throw new Error('second') })")
    page.wait_for_event("pageerror")
    assert [error for error in console_watch.unexpected() if "first" in error]
    console_watch.expect("first|second")


def test_webgl_draws_in_software(open_page: OpenPage) -> None:
    page = open_page(width=320, height=240, scheme="dark", viewer=True)
    pixel = page.evaluate(
        """() => {
            const canvas = document.createElement("canvas");
            canvas.style.cssText = "position: fixed; inset: 0; width: 100%; height: 100%";
            document.body.append(canvas);
            const gl = canvas.getContext("webgl2", { preserveDrawingBuffer: true });
            gl.clearColor(0, 1, 0, 1);
            gl.clear(gl.COLOR_BUFFER_BIT);
            const read = new Uint8Array(4);
            gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, read);
            return [...read];
        }"""
    )
    assert pixel == [0, 255, 0, 255]
    picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
    assert picture.getpixel((160, 120)) == (0, 255, 0), "what WebGL drew is what the page shows"
