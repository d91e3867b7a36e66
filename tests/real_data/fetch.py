#!/usr/bin/env python3
"""Download the third-party files that tests and experiments read (docs/guide/test_data.md).

    fetch.py FOLDER          download what is missing, then list what cannot be downloaded
    fetch.py --check FOLDER  only check the files of the folder
    fetch.py --list          print each file with its size, origin and source

Exit code: 0 if all files are present, 1 if a file is missing or wrong, 2 for wrong arguments.
Needs Python 3.11 and no packages.
"""

import argparse
import hashlib
import http.client
import json
import os
import pathlib
import shutil
import ssl
import sys
import tarfile
import tempfile
import urllib.error
import urllib.parse
import urllib.request
import zipfile

SOURCES = pathlib.Path(__file__).with_name("sources.json")
TIMEOUT_S = 60
# A host that fails this many times in a row without an answer is skipped.
MAX_FAILURES = 3
BLOCK = 1 << 20
# Names of the states that check() returns.
PRESENT, MISSING, WRONG = "present", "missing", "wrong"


class FetchError(Exception):
    """A source that does not deliver a file."""


class SkippedError(FetchError):
    """A source that was not tried again because it failed before."""


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check(folder, file):
    """State of a file in the folder, and the reason if it is wrong."""
    path = folder / file["path"]
    if not path.exists():
        return MISSING, None
    if not path.is_file():
        return WRONG, "not a file"
    size = path.stat().st_size
    if size != file["bytes"]:
        return WRONG, f"has {size} bytes, expected {file['bytes']}"
    found = sha256(path)
    if found != file["sha256"]:
        return WRONG, f"has SHA-256 {found}, expected {file['sha256']}"
    return PRESENT, None


class Downloader:
    """Downloads files and keeps archives until the end of the run."""

    def __init__(self, sources, files, scratch):
        self.sources = sources
        self.scratch = pathlib.Path(scratch)
        self.failures = {}
        # The members that an archive may have to deliver.
        self.members = {}
        for file in files:
            for name, path, _ in file.get("from", []):
                if "archive" in sources[name]:
                    self.members.setdefault(name, set()).add(path)
        # Name of an archive: extracted members by name, or the error.
        self.archives = {}

    def url(self, name, path):
        source = self.sources[name]
        return source.get("archive") or source["base"] + urllib.parse.quote(path)

    def download(self, url, target, max_bytes=None):
        host = urllib.parse.urlsplit(url).netloc
        if self.failures.get(host, 0) >= MAX_FAILURES:
            raise SkippedError(f"{url}: {host} did not answer {MAX_FAILURES} times")
        request = urllib.request.Request(url, headers={"User-Agent": "replica-test-data/1"})
        try:
            with urllib.request.urlopen(request, timeout=TIMEOUT_S) as reply, open(target, "wb") as out:
                size = 0
                while block := reply.read(BLOCK):
                    size += len(block)
                    if max_bytes is not None and size > max_bytes:
                        raise FetchError(f"{url}: larger than the expected {max_bytes} bytes")
                    out.write(block)
        except urllib.error.HTTPError as error:
            self.failures[host] = 0
            raise FetchError(f"{url}: HTTP {error.code} {error.reason}") from error
        except (urllib.error.URLError, http.client.HTTPException, ssl.SSLError, TimeoutError, ConnectionError) as error:
            self.failures[host] = self.failures.get(host, 0) + 1
            if self.failures[host] == MAX_FAILURES:
                print(f"{host} did not answer {MAX_FAILURES} times; its other files are skipped", file=sys.stderr)
            raise FetchError(f"{url}: {getattr(error, 'reason', None) or error}") from error
        self.failures[host] = 0

    def extracted(self, name):
        """The wanted members of an archive, downloaded at the first call."""
        if name not in self.archives:
            url = self.sources[name]["archive"]
            print(f"downloading {url}", flush=True)
            try:
                packed = self.scratch / f"{name}.archive"
                self.download(url, packed)
                self.archives[name] = self.extract(packed, name)
                packed.unlink()
            except (FetchError, tarfile.TarError, zipfile.BadZipFile, EOFError, ValueError) as error:
                self.archives[name] = SkippedError(f"{url}: the archive failed")
                if isinstance(error, FetchError):
                    raise
                raise FetchError(f"{url}: {error}") from error
        if isinstance(self.archives[name], SkippedError):
            raise self.archives[name]
        return self.archives[name]

    def extract(self, packed, name):
        found = {}

        def keep(member, stream):
            target = self.scratch / f"{name}.{len(found)}"
            with open(target, "wb") as out:
                shutil.copyfileobj(stream, out)
            found[member] = target

        wanted = self.members[name]
        if zipfile.is_zipfile(packed):
            with zipfile.ZipFile(packed) as archive:
                for member in wanted.intersection(archive.namelist()):
                    with archive.open(member) as stream:
                        keep(member, stream)
        else:
            with tarfile.open(packed, "r:*") as archive:
                for member in archive:
                    if member.isfile() and member.name in wanted:
                        keep(member.name, archive.extractfile(member))
        return found

    def fetch(self, file, target):
        """Write a file from the first source whose content has the expected SHA-256; return the URL."""
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f".{target.name}.part")
        errors = []
        for name, path, _ in file["from"]:
            url = self.url(name, path)
            try:
                if "archive" in self.sources[name]:
                    members = self.extracted(name)
                    if path not in members:
                        raise FetchError(f"{url}: no member {path}")
                    shutil.copyfile(members[path], part)
                else:
                    self.download(url, part, file["bytes"])
                found = sha256(part)
                if found != file["sha256"]:
                    raise FetchError(f"{url}: {path} has SHA-256 {found}, expected {file['sha256']}")
                os.replace(part, target)
                return url
            except FetchError as error:
                errors.append(error)
            finally:
                part.unlink(missing_ok=True)
        kind = SkippedError if all(isinstance(error, SkippedError) for error in errors) else FetchError
        raise kind("; ".join(map(str, errors)))


def fetch_all(table, folder):
    """Download the missing files of the table. Files that are present are never overwritten."""
    missing = [file for file in table["files"] if check(folder, file)[0] == MISSING and "from" in file]
    if not missing:
        return
    print(f"{len(missing)} files to download", flush=True)
    with tempfile.TemporaryDirectory(prefix="replica-test-data-") as scratch:
        downloader = Downloader(table["sources"], missing, scratch)
        n_skipped = 0
        for file in missing:
            try:
                url = downloader.fetch(file, folder / file["path"])
                print(f"{file['path']}: downloaded from {url}", flush=True)
            except SkippedError:
                n_skipped += 1
            except (FetchError, OSError) as error:
                print(f"{file['path']}: failed: {error}", file=sys.stderr, flush=True)
        if n_skipped:
            print(f"{n_skipped} files skipped: their archives or hosts failed", file=sys.stderr)


def origin_text(origin):
    page = f", {origin['page']}" if "page" in origin else ""
    return f"{origin['project']}{page} (licence: {origin['licence']})"


def source_text(table, file):
    """Where a file comes from, in one line."""
    if "made_from" in file:
        return f"conversion: {file['made_from']}"
    if "from" not in file:
        return f"no URL known. {file['note']}"
    name, path, _ = file["from"][0]
    source = table["sources"][name]
    tried = "" if source["tried"] else " (not tried)"
    if "archive" in source:
        return f"{source.get('package') or source['archive']}, member {path}{tried}"
    return f"{source['base']}{urllib.parse.quote(path)}{tried}"


def report(table, folder):
    """Print missing and wrong files by origin, and the counts; return the exit code."""
    states = [(file, *check(folder, file)) for file in table["files"]]
    for key, origin in table["origins"].items():
        absent = [file for file, state, _ in states if state == MISSING and file["origin"] == key]
        if absent:
            print(f"missing, from {origin_text(origin)}:")
        for file in absent:
            used = f" [only for {file['needed_by']}]" if "needed_by" in file else ""
            print(f"  {file['path']}{used}: {source_text(table, file)}")
    for file, state, reason in states:
        if state == WRONG:
            print(f"wrong: {folder / file['path']} {reason}; remove it to download it again")
    for name in table["folders"]:
        inside = [state for file, state, _ in states if file["path"].startswith(name + "/") and "needed_by" not in file]
        n_present = inside.count(PRESENT)
        if 0 < n_present < len(inside):
            print(
                f"incomplete: {folder / name}: {n_present} of {len(inside)} files. Tests that read the whole folder are ignored"
            )
    count = {name: sum(state == name for _, state, _ in states) for name in (PRESENT, MISSING, WRONG)}
    print(f"{folder}: {count[PRESENT]} files present, {count[MISSING]} missing, {count[WRONG]} wrong")
    return 0 if count[PRESENT] == len(states) else 1


def print_table(table):
    for file in table["files"]:
        print(f"{file['path']}\t{file['bytes']}\t{file['origin']}\t{source_text(table, file)}")
    total = sum(file["bytes"] for file in table["files"])
    with_url = sum("from" in file for file in table["files"])
    print(f"{len(table['files'])} files, {total / 1e6:.0f} MB; {with_url} with a URL")
    for key, origin in table["origins"].items():
        print(f"{key}: {origin_text(origin)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", nargs="?", type=pathlib.Path, help="folder of the data, e.g. ../shared/data")
    parser.add_argument("--check", action="store_true", help="only check the files of the folder")
    parser.add_argument("--list", action="store_true", help="print each file with its size, origin and source")
    parser.add_argument("--sources", type=pathlib.Path, default=SOURCES, help="table of the files (default: %(default)s)")
    options = parser.parse_args()
    if not (options.list or options.folder):
        parser.error("name the folder of the data, or use --list")
    table = json.loads(options.sources.read_text(encoding="utf-8"))
    if options.list:
        print_table(table)
        return 0
    if not options.check:
        fetch_all(table, options.folder)
    return report(table, options.folder)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader of the output has ended, e.g. `head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
