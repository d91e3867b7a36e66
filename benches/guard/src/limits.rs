//! The recorded counts.

use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest allowed count as a multiple of the recorded one.
    pub max_ratio: f64,
    /// Instructions of one round by kernel.
    pub instructions: BTreeMap<String, u64>,
}

fn path() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "limits.toml"].iter().collect()
}

impl Limits {
    pub fn load() -> anyhow::Result<Self> {
        let text = std::fs::read_to_string(path()).with_context(|| path().display().to_string())?;
        toml::from_str(&text).with_context(|| path().display().to_string())
    }

    pub fn save(&self) -> anyhow::Result<()> {
        let text = format!("# Written by `cargo run --release -p guard -- --update`.\n{}", toml::to_string(self)?);
        std::fs::write(path(), text).with_context(|| path().display().to_string())
    }
}
