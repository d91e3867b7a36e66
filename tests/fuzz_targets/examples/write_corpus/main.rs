//! Writes the seeds of the corpus: a small valid file for each target, made by the writers of the formats.
//!
//! `cargo run --release -p fuzz_targets --example write_corpus`. Files whose names do not start with `seed` are
//! findings of earlier fuzzing; they are left alone.

mod data_sets;
mod ros;
mod runs;
mod seeds;

use std::fs;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (target, files) in seeds::all() {
        let folder = corpus.join(target);
        fs::create_dir_all(&folder)?;
        for (number, bytes) in files.iter().enumerate() {
            fs::write(folder.join(format!("seed_{number}")), bytes)?;
        }
    }
    Ok(())
}
