"""A broker that wants TLS and a password: mosquitto, with a certificate authority of its own."""

import base64
import datetime
import hashlib
import ipaddress
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from typer.testing import CliRunner

from app.cli.main import app
from app.i18n.reasons.rendering import explained
from harness.contracts.errors import HarnessError
from tests.builders.vehicle_sites import answers, free_port, process, write_site

PASSWORD = "a password of this test"
CONFIGURATION = """\
per_listener_settings true
listener {open} 127.0.0.1
allow_anonymous true
listener {closed} 127.0.0.1
allow_anonymous false
password_file {folder}/passwords
certfile {folder}/server.pem
keyfile {folder}/server.key
"""


def write_certificate(folder: Path) -> None:
    """A certificate for 127.0.0.1 that signs itself, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "127.0.0.1")])
    now = datetime.datetime.now(datetime.UTC)
    alternative = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address("127.0.0.1"))])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=1))
        .add_extension(alternative, critical=False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    (folder / "server.pem").write_bytes(certificate.public_bytes(pem))
    form, bare = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    (folder / "server.key").write_bytes(key.private_bytes(pem, form, bare))


@pytest.fixture
def ports(peers: Path, tmp_path: Path) -> Iterator[tuple[int, int]]:
    """An open port for the vehicle, and one with TLS and a password."""
    program = peers / "mosquitto" / "bin" / "mosquitto"
    if not program.exists():
        pytest.skip("mosquitto is not installed")
    write_certificate(tmp_path)
    salt = b"twelve bytes"
    digest = hashlib.pbkdf2_hmac("sha512", PASSWORD.encode(), salt, 101)
    encoded = [base64.b64encode(one).decode() for one in (salt, digest)]
    (tmp_path / "passwords").write_text(f"regen:$7$101${encoded[0]}${encoded[1]}\n")
    for file in tmp_path.iterdir():
        file.chmod(0o644)
    for folder in (tmp_path, *tmp_path.parents[:2]):
        folder.chmod(0o755)
    found = free_port(), free_port()
    configuration = tmp_path / "mosquitto.conf"
    configuration.write_text(CONFIGURATION.format(open=found[0], closed=found[1], folder=tmp_path))
    with process([program, "-c", configuration], tmp_path):
        until_s = time.monotonic() + 10.0
        while not answers(found[1]) and time.monotonic() < until_s:
            time.sleep(0.05)
        yield found


@pytest.mark.parametrize(
    ("password", "authority_file", "said"),
    [
        (PASSWORD, "server.pem", "vda5050 was never checked at this address"),
        ("another", "server.pem", "The MQTT broker refused the connection (Not authorized)"),
        (PASSWORD, "", "The MQTT broker did not answer (SSLCertVerificationError)"),
        (PASSWORD, "missing.pem", "The file of the broker's certificate authority is missing"),
    ],
)
# paho-mqtt leaves the socket of a failed handshake to the garbage collector, which warns
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_broker_with_tls_and_a_password_lets_in_who_has_both(
    ports: tuple[int, int], tmp_path: Path, password: str, authority_file: str, said: str
) -> None:
    site = write_site(
        tmp_path / "shop",
        ports[1],
        address=f"mqtts://127.0.0.1:{ports[1]}",
        user="regen",
        password={"environment": "BROKER_PASSWORD"},
        authority_file=f"../{authority_file}" if authority_file else "",
    )
    words = [sys.executable, "docs/examples/vehicle.py", "--broker", f"127.0.0.1:{ports[0]}"]
    with process(words, tmp_path, ready="/Acme/0001"):
        runner = CliRunner(env={"BROKER_PASSWORD": password})
        done = runner.invoke(app, ["mission", "run", "go-to-place", "--site", str(site), "--speed", "0"])
    error = explained(done.exception) if isinstance(done.exception, HarnessError) else ""
    assert said in f"{done.output} {done.stderr} {error}"
    assert password not in f"{done.output} {done.stderr} {error}"
