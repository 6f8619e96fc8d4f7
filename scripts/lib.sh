# shellcheck shell=bash
# What the scripts share: where things are, how cargo is called, and what the machine must have.
# Sourced, never run. Works with the bash 3.2 of macOS.

repo_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# Outside the clone, so that a second clone (or a clean one) builds on what the first one compiled.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/bevy_cumulus/target}"
# A binary that cargo did not start looks for assets/ beside itself unless told otherwise.
export BEVY_ASSET_ROOT="${BEVY_ASSET_ROOT:-$repo_root}"

# One feature set for all that the scripts build: with a second one, cargo would compile Bevy a second time.
# shellcheck disable=SC2034 # used by the scripts
features=(--features inspector)

rust_bevy_declares=1.97.1 # what Bevy 0.20.1 asks for; it builds on less
rust_minimum=1.95.0       # the oldest Rust that we test
mesa_minimum=23           # 22.3.6, which is Debian 12's, crashes within a few frames

no_install=false
missing=() # what --no-install would not install, and what we cannot install on this system

say() { printf '\n== %s\n' "$*" >&2; }
die() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}
has() { command -v "$1" >/dev/null 2>&1; }

# ---- Rust ------------------------------------------------------------------------------------------------------------

version_below() { # version_below 1.95.0 1.97.1; a suffix such as -nightly counts for nothing
    local a b i
    IFS=. read -r -a a <<<"${1%%-*}"
    IFS=. read -r -a b <<<"${2%%-*}"
    for i in 0 1 2; do
        ((10#${a[i]:-0} == 10#${b[i]:-0})) || return $((10#${a[i]:-0} > 10#${b[i]:-0}))
    done
    return 1
}

rust_version=
ensure_rust() {
    # A shell opened before rustup ran does not have its folder on the path yet.
    has cargo || PATH="$PATH:${CARGO_HOME:-$HOME/.cargo}/bin"
    if ! has cargo || ! has rustc; then
        die "cargo or rustc is missing: install Rust $rust_minimum or newer with rustup (https://rustup.rs)"
    fi
    rust_version=$(rustc --version | cut -d' ' -f2) || die "rustc does not start: see 'rustup show'"
    if version_below "$rust_version" "$rust_minimum"; then
        die "rustc is $rust_version, but $rust_minimum or newer is needed: run 'rustup update'"
    fi
}

# run_cargo SUBCOMMAND ARGS...: cargo, with the flags that this machine needs.
run_cargo() {
    local subcommand=$1 flags=(--locked)
    shift
    [ -n "$rust_version" ] || ensure_rust
    if version_below "$rust_version" "$rust_bevy_declares"; then flags=(--ignore-rust-version --locked); fi
    # mold links faster. `mold -run` only swaps the linker, so cargo rebuilds nothing because of it.
    if has mold; then
        mold -run cargo "$subcommand" "${flags[@]}" "$@"
    else
        cargo "$subcommand" "${flags[@]}" "$@"
    fi
}

# ---- packages --------------------------------------------------------------------------------------------------------

os_release() { (. /etc/os-release 2>/dev/null && eval "echo \"\${$1:-}\"") || true; }

is_debian() {
    has apt-get || return 1
    case " $(os_release ID) $(os_release ID_LIKE) " in *" debian "* | *" ubuntu "*) ;; *) return 1 ;; esac
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif has sudo; then
        sudo "$@"
    else
        die "not root and no sudo: run this as root, then try again: $*"
    fi
}

# Waits for another apt to finish rather than failing; silent but for errors.
apt() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o DPkg::Lock::Timeout=300 "$@" >/dev/null; }

lacks() { # lacks WHAT PACKAGES...: succeeds where we may install them, else notes them down for set_up to report
    local what=$1
    shift
    if is_debian && ! $no_install; then return 0; fi
    missing+=("$what: $*")
    return 1
}

# ---- C compiler (Rust links with it) ---------------------------------------------------------------------------------

cc_works() {
    has cc || return 1
    local dir status=0
    dir=$(mktemp -d)
    echo 'int main(void) { return 0; }' >"$dir/a.c"
    cc "$dir/a.c" -o "$dir/a" 2>/dev/null || status=1 # fails without the C library's headers and start-up files, too
    rm -r "$dir"
    return $status
}

ensure_cc() {
    cc_works && return
    case "$(uname -s)" in
        Darwin) missing+=("a C compiler: run 'xcode-select --install'") && return ;;
        MINGW* | MSYS*) return ;; # Rust for Windows finds its own linker
    esac
    is_debian || { missing+=("a C compiler: gcc, and the C library's development files") && return; }
    lacks "a C compiler" gcc libc6-dev || return 0
    say "installing a C compiler (gcc, libc6-dev), which Rust links with"
    apt update
    apt install gcc libc6-dev
    cc_works || die "cc does not compile an empty program, even with gcc and libc6-dev installed"
}

ensure_cxx() { # the measuring tool holds FLIP, a measure of visible difference, which is C++
    has c++ && return
    case "$(uname -s)" in
        Darwin | MINGW* | MSYS*) missing+=("a C++ compiler") && return ;;
    esac
    install_for "the measuring tool" g++
}

# ---- Vulkan ----------------------------------------------------------------------------------------------------------

vulkan_driver_dirs=(/usr/share/vulkan/icd.d /etc/vulkan/icd.d /usr/local/share/vulkan/icd.d)

has_library() { PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep -F "$1 " >/dev/null; }

has_driver() { # has_driver nvidia: a driver manifest of that name whose library is there as well
    local dir json library
    for dir in "${vulkan_driver_dirs[@]}"; do
        for json in "$dir/$1"*.json; do
            [ -r "$json" ] || continue
            library=$(sed -n 's/.*"library_path"[^"]*"\([^"]*\)".*/\1/p' "$json" | head -n 1)
            case "$library" in
                /*) [ -e "$library" ] ;;
                */*) [ -e "$dir/$library" ] ;;
                *) has_library "$library" ;;
            esac && return
        done
    done
    return 1
}

has_gpu() { # a real GPU and its driver
    [ -e /dev/nvidiactl ] && has_driver nvidia && return
    local node kernel_driver
    for node in /dev/dri/renderD*; do
        if ! [ -r "$node" ] || ! [ -w "$node" ]; then continue; fi
        kernel_driver=$(readlink "/sys/class/drm/${node##*/}/device/driver" || true)
        case "${kernel_driver##*/}" in
            amdgpu) has_driver radeon || has_driver amd ;;
            i915 | xe) has_driver intel ;;
            *) false ;;
        esac && return
    done
    return 1
}

mesa_too_old() {
    has dpkg-query || return 1
    local version
    version=$(dpkg-query -W -f '${Version}' mesa-vulkan-drivers 2>/dev/null) || return 1
    version=${version#*:}
    version=${version%%.*}
    [ -n "$version" ] && [ "$version" -lt "$mesa_minimum" ]
}

has_software_driver() { has_driver lvp_icd && ! mesa_too_old; }

vulkan_usable() {
    [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 0 # chosen by hand: not ours to judge
    has_library libvulkan.so.1 || return 1
    has_gpu || has_software_driver
}

# Prints "MIRROR|FILE:LINE" for each source of the suite that apt knows. Asking apt beats parsing: it reads both file
# formats, and knows a Debian mirror from a vendor's repository of the same suite name.
apt_sources_of() {
    # shellcheck disable=SC2016 # the fields are apt's to fill in
    apt-get indextargets --format '$(REPO_URI)|$(SOURCESENTRY)' \
        'Created-By: Packages' "Codename: $1" 'Component: main' "Origin: $2"
}

add_backports() { # needs `apt update` first: apt learns code names and origins from the indexes
    [ -z "$(apt_sources_of bookworm-backports 'Debian Backports')" ] || return 0
    local source mirror file line key
    source=$(apt_sources_of bookworm Debian | head -n 1)
    [ -n "$source" ] || die "apt's sources name no Debian 12 mirror: add bookworm-backports by hand, then try again"
    mirror=${source%%|*}
    file=${source#*|}
    line=${file##*:}
    file=${file%:*}
    # The same key: `Signed-By: PATH` in a paragraph of a .sources file, `[signed-by=PATH]` in a line of a .list file.
    case "$file" in
        *.sources) key=$(sed -n "$line,/^[[:space:]]*\$/s/^Signed-By:[[:space:]]*//Ip" "$file" | head -n 1) ;;
        *) key=$(sed -n "${line}s/.*\[.*signed-by=\([^] ]*\).*\].*/\1/Ip" "$file") ;;
    esac
    file=/etc/apt/sources.list.d/bevy_cumulus-backports.sources
    say "adding $mirror bookworm-backports to apt's sources ($file)"
    {
        printf '# Added by bevy_cumulus for mesa-vulkan-drivers; packages come from here only where asked for by name.\n'
        printf 'Types: deb\nURIs: %s\nSuites: bookworm-backports\nComponents: main\n' "$mirror"
        case "$key" in /*) printf 'Signed-By: %s\n' "$key" ;; esac
    } | as_root tee "$file" >/dev/null
    apt update
}

install_vulkan() {
    local from=() why=""
    if [ "$(os_release VERSION_CODENAME)" = bookworm ]; then
        from=(-t bookworm-backports)
        why=" (from bookworm-backports, since Debian 12's own crashes under Bevy)"
    fi
    say "installing Mesa's software Vulkan driver$why"
    apt update
    [ -z "$why" ] || add_backports
    apt install ${from[@]+"${from[@]}"} libvulkan1 mesa-vulkan-drivers
    has_software_driver || die "libvulkan1 and mesa-vulkan-drivers are installed, but give no usable driver: Mesa \
$mesa_minimum or newer is needed. With a driver of your own, point VK_DRIVER_FILES at its manifest."
}

ensure_vulkan() {
    case "$(uname -s)" in Darwin | MINGW* | MSYS*) return ;; esac # Metal, Direct3D 12: part of the system
    vulkan_usable && return
    local packages="your system's Vulkan loader and Mesa's Vulkan drivers, version $mesa_minimum or newer"
    case " $(os_release ID) $(os_release ID_LIKE) " in
        *" debian "* | *" ubuntu "*)
            packages="libvulkan1 mesa-vulkan-drivers ($mesa_minimum or newer; on Debian 12 from bookworm-backports)"
            ;;
        *" fedora "* | *" rhel "*) packages="vulkan-loader mesa-vulkan-drivers" ;;
        *" arch "*) packages="vulkan-icd-loader vulkan-swrast" ;;
    esac
    lacks "a Vulkan driver" "$packages" || return 0
    install_vulkan
}

# ---- windows ---------------------------------------------------------------------------------------------------------

# What winit loads at run time, and so no linker names: library, and its Debian package.
x_client=(libX11.so.6 libx11-6 libX11-xcb.so.1 libx11-xcb1 libXcursor.so.1 libxcursor1 libXi.so.6 libxi6
    libXrandr.so.2 libxrandr2 libxkbcommon-x11.so.0 libxkbcommon-x11-0)

# Adds to `packages` what the X client libraries that are not there come in.
add_x_client() {
    local i
    for ((i = 0; i < ${#x_client[@]}; i += 2)); do
        has_library "${x_client[i]}" || packages+=("${x_client[i + 1]}")
    done
}

install_for() { # install_for WHAT PACKAGES...: nothing, where no package is named
    local what=$1
    shift
    [ $# -gt 0 ] || return 0
    lacks "$what" "$@" || return 0
    say "installing $* for $what"
    apt update
    apt install "$@"
}

has_display() { # a screen that a window can open on
    case "$(uname -s)" in
        Darwin | MINGW* | MSYS*) [ -z "${SSH_CONNECTION:-}" ] && return ;;
    esac
    # The examples are built for X11. A Wayland desktop sets DISPLAY as well, for Xwayland.
    case "${DISPLAY:-}" in
        "") return 1 ;;
        :*)
            local number=${DISPLAY#:}
            number=${number%%.*}
            [ -S "/tmp/.X11-unix/X$number" ] || grep -q "@/tmp/.X11-unix/X$number\$" /proc/net/unix 2>/dev/null
            ;;
    esac
}

ensure_window() { # to open a window on the display that there is
    case "$(uname -s)" in Darwin | MINGW* | MSYS*) return ;; esac
    local packages=()
    add_x_client
    install_for "the window" ${packages[@]+"${packages[@]}"}
}

ensure_virtual_display() { # to open windows where there is no screen, and to press their keys
    case "$(uname -s)" in Darwin | MINGW* | MSYS*) return ;; esac # the window tests are Linux's alone
    local packages=()
    has Xvfb || packages+=(xvfb)
    has xdotool || packages+=(xdotool)
    has wmctrl || packages+=(wmctrl)
    has blackbox || packages+=(blackbox)
    add_x_client
    install_for "the window tests" ${packages[@]+"${packages[@]}"}
}

# ---- all scripts ----------------------------------------------------------------------------------------------------

set_up() { # set_up [ENSURE_...]: what every script needs, and what this one needs besides
    ensure_rust
    ensure_cc
    ensure_vulkan
    local ensure
    for ensure in "$@"; do "$ensure"; done
    if [ ${#missing[@]} -gt 0 ]; then
        printf 'missing (nothing was installed):\n' >&2
        printf '  %s\n' "${missing[@]}" >&2
        exit 3
    fi
}
