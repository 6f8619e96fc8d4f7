# shellcheck shell=bash
# What scripts/fidelity, scripts/ladder and scripts/motion share. Sourced after lib.sh, never run.
# shellcheck disable=SC2034,SC2154 # variables of lib.sh and of the scripts

measure_options="  --no-install     install nothing; where something is missing, name it and exit with status 3
  --full           1920x1080 and more samples: for a GPU
  --size WxH       size of the pictures (128x72; fidelity 96x54)
  --zoom Z         show the middle of each view Z times larger, so that small pictures have fine pixels (3; with --full 1)
  --spp N          samples a pixel of each reference picture (128; fidelity 64; with --full 4096)
  --only A,B       only these parts; the report then goes to the output folder
  --out DIR        where results go
  --report FILE    the report, if not in its usual place
  --minutes N      stop after so many minutes; the same command then goes on from there
  --keep           keep every picture and its timings there
  --fresh          make the references anew, though nothing that they depend on has changed
  --truth-quality NAME  a quality preset in the path tracer's stead, to work on this script; the report goes to the
                   output folder"

# measure WHAT ARGS...: builds the renderer and the tool, then runs it.
measure() {
    local arg args=() what=$1
    shift
    for arg in "$@"; do
        if [ "$arg" = --no-install ]; then no_install=true; else args+=("$arg"); fi
    done
    cd "$repo_root" || die "there is no $repo_root"
    set_up ensure_cxx
    say "building the renderer (the first time Bevy is compiled as well, which takes a while) and the tool"
    run_cargo build --example headless "${features[@]}"
    local headless=$CARGO_TARGET_DIR/debug/examples/headless
    # Beside the renderer's, since another feature set in the same place would have cargo build things twice.
    CARGO_TARGET_DIR=$CARGO_TARGET_DIR/measure run_cargo build --manifest-path scripts/measure/Cargo.toml
    say "measuring"
    "$CARGO_TARGET_DIR/measure/debug/cumulus_measure" "$what" --headless "$headless" --repository "$repo_root" \
        ${args[@]+"${args[@]}"} </dev/null
}
