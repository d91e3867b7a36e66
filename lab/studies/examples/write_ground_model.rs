//! Writes the ground model: `cargo run -p studies --example write_ground_model -- models/ground.safetensors`.
//! The same program always writes the same bytes.

use ground::Parameters;
use segmentation::ground_quasi_flat::encode;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(path) = std::env::args_os().nth(1) else {
        eprintln!("usage: write_ground_model PATH");
        return ExitCode::from(2);
    };
    let written = encode(&Parameters::default())
        .map_err(|error| error.to_string())
        .and_then(|bytes| std::fs::write(&path, bytes).map_err(|error| error.to_string()));
    match written {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", path.display());
            ExitCode::FAILURE
        }
    }
}
