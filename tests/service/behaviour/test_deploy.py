"""What lies in deploy/: its commands are ours, its checks notice what hangs, its proxies pass everything on."""

import configparser
import json
import re
import shlex
import shutil
import socket
import ssl
import subprocess
import sys
import threading
import time
import urllib.request
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import pytest
from ruamel.yaml import YAML
from service_process import free_port, serving, wait_until_ready
from typer.main import get_command

from optiplan.cli.program import program
from optiplan.service.health import feed_watchdog
from tests.small_problems import NO_WAY, QUICK
from tests.waiting import wait_until

DEPLOY = Path(__file__).parents[3] / "deploy"
TOKEN = "0123456789abcdef0123456789abcdef"


def parsed(words):
    """The options of a command of ours as the program reads them; it refuses those that it does not have."""
    command = get_command(program()).commands[words[0]]
    with command.make_context(words[0], words[1:]) as context:
        return context.params


@pytest.fixture(scope="module")
def compose():
    return YAML(typ="safe").load((DEPLOY / "compose.yaml").read_text())


def test_an_option_that_there_is_not_is_noticed():
    with pytest.raises(Exception, match="worker-threads"):
        parsed(["serve", "--worker-threads=2"])


def test_services_run_commands_of_ours_with_secrets_that_are_theirs(compose):
    for name, solvers in (("server", 0), ("worker", None)):
        service = compose["services"][name]
        options = parsed(service["command"])
        assert options["solvers"] == solvers
        assert str(options["data"]) == "/data" == service["volumes"][0].partition(":")[2]
        for file in (options["database_password_file"], options.get("token_file")):
            assert file is None or file.name in service["secrets"]
        assert all(secret in compose["secrets"] for secret in service["secrets"])
        assert re.fullmatch(r"postgresql://\w+@\w+/\w+", options["database"]), "no password among the arguments"
        assert "$" not in " ".join(service["command"]), "nor put there by a shell"
        assert service["ulimits"]["nofile"] >= 2**16
        assert int(service["stop_grace_period"].rstrip("s")) > 20
    assert compose["services"]["database"]["environment"]["POSTGRES_PASSWORD_FILE"].endswith("database-password")


def checked_address(words):
    """The address that a health check asks."""
    return re.search(r"urlopen\('(http://[^']+)'", " ".join(words))[1]


def test_server_and_workers_are_asked_whether_they_can_work(compose):
    docker = (DEPLOY / "Dockerfile").read_text()
    check = re.search(r"HEALTHCHECK.* CMD \\\n (\[.*\])", docker)[1]
    start = json.loads(re.search(r"\nCMD (\[.*\])", docker)[1])
    assert checked_address(json.loads(check)) == f"http://127.0.0.1:{parsed(start)['port']}/readyz"
    assert "healthcheck" not in compose["services"]["server"], "that of the image is it"
    worker = compose["services"]["worker"]
    port = parsed(worker["command"])["health_port"]
    assert checked_address(worker["healthcheck"]["test"]) == f"http://127.0.0.1:{port}/readyz"


def test_a_check_fails_where_nobody_answers_or_not_well(compose):
    command = compose["services"]["worker"]["healthcheck"]["test"]
    assert command[0] == "CMD"
    with socket.create_server(("127.0.0.1", 0)) as sock:
        text = command[-1].replace("7101", str(sock.getsockname()[1]))

        def answer():
            for status in ("503 Service Unavailable", "200 OK"):
                client = sock.accept()[0]
                client.recv(65536)
                client.sendall(f"HTTP/1.1 {status}\r\nContent-Length: 0\r\n\r\n".encode())
                client.close()

        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        codes = [subprocess.run([sys.executable, "-c", text], capture_output=True).returncode for _ in range(2)]
        thread.join()
    assert codes == [1, 0]
    assert subprocess.run([sys.executable, "-c", text], capture_output=True).returncode == 1


def test_workers_have_a_share_of_the_cores(compose):
    worker = compose["services"]["worker"]
    assert "cpus" in worker["deploy"]["resources"]["limits"]
    assert parsed(worker["command"])["solvers"] is None, "as many as the share is worth"


@pytest.fixture(scope="module")
def unit():
    found = configparser.RawConfigParser(strict=False)
    found.optionxform = str
    found.read(DEPLOY / "optiplan.service")
    return found["Service"]


def test_the_unit_starts_a_command_of_ours_and_again_where_it_hangs(unit):
    program, *words = shlex.split(unit["ExecStart"])
    assert Path(program).name == "optiplan"
    assert parsed(words)["data"] == Path("/var/lib") / unit["StateDirectory"]
    assert int(unit["LimitNOFILE"]) >= 2**16
    assert int(unit["WatchdogSec"]) > 0
    assert unit["NotifyAccess"] == "main"
    assert int(unit["TimeoutStopSec"]) > 20


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd")
def test_systemd_takes_the_unit(tmp_path, unit):
    file = tmp_path / "optiplan.service"
    file.write_text((DEPLOY / "optiplan.service").read_text().replace(shlex.split(unit["ExecStart"])[0], "/bin/true"))
    found = subprocess.run(["systemd-analyze", "verify", "--man=no", str(file)], capture_output=True, text=True)
    assert not [line for line in found.stderr.splitlines() if file.name in line]
    assert found.returncode == 0, found.stderr


def test_nothing_is_installed_from_an_index_under_our_name():
    for file in DEPLOY.iterdir():
        for words in re.findall(r"pip install(.*)", file.read_text()):
            assert not re.search(r"(^| )optiplan", words), file.name


def test_the_watchdog_is_fed_while_the_process_lives(tmp_path, monkeypatch):
    looks = []

    def alive():
        looks.append(len(looks))
        return len(looks) > 3

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(30.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "30000")
        stop = feed_watchdog(alive)
        assert manager.recv(100) == b"WATCHDOG=1"
        assert len(looks) >= 4, "nothing is said for threads that have ended"
        stop.set()


def for_nginx(folder, port, prefix):
    """The file of deploy/ with our port, name, certificate and path, within what an nginx that is not root needs."""
    text = (DEPLOY / "nginx.conf").read_text().replace("listen 443", f"listen 127.0.0.1:{port}")
    text = text.replace("listen 80", f"listen 127.0.0.1:{free_port()}").replace("planner.example;", "localhost;")
    text = text.replace("/etc/ssl/planner.example", str(folder / "proxy")).replace(
        "location / {", f"location {prefix}/ {{"
    )
    kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    places = "".join(f"{kind}_temp_path {folder}/{kind};" for kind in kinds)
    return f"pid {folder}/pid; error_log stderr; events {{}} http {{ access_log off; {places} {text} }}"


def for_caddy(folder, port, prefix):
    """Likewise."""
    text = (DEPLOY / "Caddyfile").read_text().replace("reverse_proxy 127", f"reverse_proxy {prefix}/* 127")
    ours = f"https://localhost:{port} {{\n\tbind 127.0.0.1\n\ttls {folder}/proxy.pem {folder}/proxy.key"
    return "{\n\tadmin off\n\tauto_https disable_redirects\n}\n" + text.replace("planner.example {", ours)


PROXIES = {
    "nginx": (for_nginx, ["nginx", "-t"], ["nginx", "-g", "daemon off;"], ["-p", "{folder}", "-c", "{file}"]),
    "caddy": (for_caddy, ["caddy", "validate"], ["caddy", "run"], ["--adapter", "caddyfile", "--config", "{file}"]),
}


@contextmanager
def proxied(name, folder, server_port, prefix):
    """A proxy with the file of deploy/, on a free port with a certificate of our own; yields address and trust."""
    port, file = free_port(), folder / "conf"
    certificate = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    certificate += ["-days", "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost"]
    certificate += ["-keyout", str(folder / "proxy.key"), "-out", str(folder / "proxy.pem")]
    subprocess.run(certificate, check=True, capture_output=True)
    written, check, run, where = PROXIES[name]
    file.write_text(written(folder, port, prefix).replace("127.0.0.1:7100", f"127.0.0.1:{server_port}"))
    where = [word.format(folder=folder, file=file) for word in where]
    environment = {"PATH": "/usr/bin:/usr/sbin:/bin", "HOME": str(folder), "XDG_DATA_HOME": str(folder)}
    valid = subprocess.run([*check, *where], capture_output=True, text=True, env=environment)
    assert valid.returncode == 0, valid.stderr
    process = subprocess.Popen([*run, *where], stderr=subprocess.DEVNULL, env=environment)
    try:
        while True:
            assert process.poll() is None
            with suppress(OSError):
                socket.create_connection(("127.0.0.1", port), 1.0).close()
                break
            time.sleep(0.05)
        yield f"https://localhost:{port}{prefix}", ssl.create_default_context(cafile=str(folder / "proxy.pem"))
    finally:
        process.terminate()
        process.wait(20.0)


@pytest.fixture(scope="module", params=["", "/optiplan"])
def behind(request, tmp_path_factory):
    """A server that trusts a proxy, at the top and below a path; its address and folder."""
    if not any(map(shutil.which, PROXIES)):  # before two servers are started for nothing
        pytest.skip(f"neither of {', '.join(PROXIES)}")
    folder = tmp_path_factory.mktemp("behind")
    (folder / "token").write_text(TOKEN)
    options = ["--trusted-proxy", "127.0.0.1", "--allow-host", "localhost", "--token-file", str(folder / "token")]
    options += ["--connections", "4", *(["--root-path", request.param] if request.param else [])]
    with serving(folder / "data", *options) as server:
        wait_until_ready(server.url)
        yield server, folder, request.param


@pytest.mark.parametrize("program", ["nginx", "caddy"])
def test_all_passes_through_a_proxy(behind, program, tmp_path):
    if shutil.which(program) is None:
        pytest.skip(f"no {program}")
    server, folder, prefix = behind
    port = int(server.url.rpartition(":")[2])
    with proxied(program, tmp_path, port, prefix) as (url, trust), httpx.Client(verify=trust, timeout=60.0) as http:
        opened = http.get(f"{url}/studio?token={TOKEN}")
        assert opened.status_code == 303
        assert opened.headers["location"] == f"{prefix}/studio"
        assert "; Secure" in opened.headers["set-cookie"]
        assert http.get(url.removesuffix(prefix) + opened.headers["location"]).status_code == 200, "by the cookie"
        origin = url.removesuffix(prefix)
        assert http.post(f"{url}/api/problems/validate", json={"problem": QUICK}, headers={"Origin": origin}).json()[
            "valid"
        ]
        assert (
            http.post(f"{url}/api/problems/validate", json={}, headers={"Origin": "https://evil.example"}).status_code
            == 403
        )
        for _ in range(30):  # what is refused before it is read, each time
            assert http.post(f"{url}/api/nothing", json={}).status_code == 404
            assert http.post(f"{url}/api/robots", json={}).status_code == 405
            assert httpx.post(f"{url}/api/plan", json={}, verify=trust).status_code == 401
        planned = http.post(f"{url}/api/plan", json={"problem": QUICK}).json()
        assert planned["verified"] is True
        assert http.head(f"{url}/api/runs/{planned['id']}/run.json").status_code == 200
        run = http.post(f"{url}/api/runs", json={"problem": NO_WAY, "budget": 1.0, "seed": 3}).json()["id"]
        with http.stream("GET", f"{url}/api/runs/{run}/events") as lines:
            events = [json.loads(line[5:]) for line in lines.iter_lines() if line.startswith("data:")]
        assert events[-1]["type"] == "end"
        client = {"X-Forwarded-For": "203.0.113.9", "Authorization": f"Bearer {TOKEN}"}
        assert http.get(f"{url}/api/runs", headers=client).status_code == 200
        with pytest.raises(urllib.error.HTTPError) as large:
            urllib.request.urlopen(f"{url}/api/runs", data=b"x" * 6_000_000, context=trust)
        assert large.value.code in (401, 413)
        many = [httpx.Client(verify=trust, headers=client) for _ in range(8)]
        assert all(each.get(f"{url}/api/robots").status_code == 200 for each in many), "a proxy has no bound of clients"
        for each in many:
            each.close()
    log = [json.loads(line) for line in (folder / "server.log").read_text().splitlines() if line.startswith("{")]
    assert "203.0.113.9" not in {line.get("client") for line in log}, "who may not say so is not believed"


def test_who_is_no_proxy_of_ours_is_not_believed(tmp_path):
    forwarded = {"X-Forwarded-For": "203.0.113.9", "X-Forwarded-Proto": "https"}
    with serving(tmp_path / "data", "--log-level", "info") as server:
        httpx.get(f"{server.url}/healthz", headers=forwarded, trust_env=False)
        log = tmp_path / "server.log"
        wait_until(lambda: '"client"' in log.read_text())  # written after the answer
        text = log.read_text()
    assert "203.0.113.9" not in text
    assert '"client": "127.0.0.1"' in text
