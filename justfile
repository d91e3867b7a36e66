# Short names of the checks; CONTRIBUTING.md describes them. `just` is optional: each line can be typed.

# Format, lints and tests of the crates that differ from a commit.
quick commit="main":
    .ci/quick {{commit}}

# All tests, as the README says.
test:
    cargo test --release --workspace --tests --locked

# Everything that must hold before a change lands.
full:
    .ci/run

# The same, then soaks, debug assertions, miri, the oldest Rust, advisories.
nightly:
    .ci/run --nightly
