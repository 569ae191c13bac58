#!/bin/sh
# Prints the path of a headless Chromium for the tests of pages, and installs one into .venv/browser where none is there.
# What cannot be installed is said on the error output; the tests of pages are then skipped.
#
# It is looked for in CAROM_BROWSER, on the PATH and in .venv/browser, as tests/browser.py does. The npm package below ships
# the program itself, which needs NSS and fontconfig from the machine; CI as root takes the distribution's Chromium instead.

cd "$(dirname "$0")/.." || exit 2
package=@sparticuz/chromium@153.0.0
sha256=20e5656fcdcf4118ede85edfb9d6bb9cc1bbb7ffb8b75622fffbcf36a835c3c0
folder=.venv/browser

find_one() {
    for program in "$CAROM_BROWSER" chromium chromium-browser google-chrome google-chrome-stable chrome "$folder/chromium"; do
        [ -n "$program" ] && command -v "$program" 2>/dev/null && return
    done
    return 1
}

from_npm() {
    command -v npm >/dev/null && command -v node >/dev/null && [ "$(uname -sm)" = "Linux x86_64" ] || return 1
    rm -rf "$folder" && mkdir -p "$folder" || return 1
    npm pack --silent --fetch-retries=0 --pack-destination "$folder" "$package" >/dev/null &&
        echo "$sha256  $(echo "$folder"/*.tgz)" | sha256sum --check --quiet &&
        tar -xzf "$folder"/*.tgz -C "$folder" --strip-components=2 package/bin || return 1
    for name in chromium swiftshader.tar; do
        node -e 'process.stdout.write(zlib.brotliDecompressSync(fs.readFileSync(process.argv[1])))' \
            "$folder/$name.br" >"$folder/$name" || return 1
    done
    tar -xf "$folder/swiftshader.tar" -C "$folder"
    rm -f "$folder"/*.br "$folder"/*.tar "$folder"/*.tgz
    chmod +x "$folder/chromium"
    "$folder/chromium" --version >/dev/null
}

from_apt() {
    [ -n "$CI" ] && [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
    apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends chromium
}

find_one && exit
mkdir -p .make
{ from_apt || from_npm || rm -rf "$folder"; } >.make/browser.log 2>&1
find_one || echo "carom: no Chromium here, and none could be installed (.make/browser.log). Tests of pages are skipped" >&2
