//! `run/costs.csv`: work and cost of each stage over time, a line a second. `replica-lab evaluate trajectory RUN --out
//! DIR` plots time per sweep and memory over the drive from it.

use crate::metrics::StageHealth;
use run::health::Health;
use run::process::Usage;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const WRITE_EVERY: Duration = Duration::from_secs(1);
const HEADER: &str = "wall_s,stage,drive_s,ticks,cpu_s,resident_bytes\n";

/// Appends to the file; a restart continues it.
pub struct Costs {
    file: PathBuf,
    begun: Instant,
    written: Option<Instant>,
    /// Ticks in the last line of each stage: a stage without a new tick gets no line.
    written_ticks: BTreeMap<String, u64>,
    has_failed: bool,
}

impl Costs {
    /// A table without lines.
    pub fn new(file: PathBuf) -> Self {
        Self { file, begun: Instant::now(), written: None, written_ticks: BTreeMap::new(), has_failed: false }
    }

    /// Writes if the interval has passed.
    pub fn update<'a>(&mut self, stages: impl Iterator<Item = StageHealth<'a>>) {
        if !self.has_failed && self.written.is_none_or(|written| written.elapsed() >= WRITE_EVERY) {
            self.write(stages);
        }
    }

    /// Writes a line for each stage with new ticks. If the file cannot be written, the first failure is logged.
    pub fn write<'a>(&mut self, stages: impl Iterator<Item = StageHealth<'a>>) {
        self.written = Some(Instant::now());
        let text = self.lines(stages);
        if let Err(error) = append(&self.file, &text)
            && !std::mem::replace(&mut self.has_failed, true)
        {
            tracing::warn!("costs cannot be written: {}: {error}", self.file.display());
        }
    }

    fn lines<'a>(&mut self, stages: impl Iterator<Item = StageHealth<'a>>) -> String {
        let wall_s = self.begun.elapsed().as_secs_f64();
        let mut text = String::new();
        for StageHealth { stage, health } in stages {
            let Some(begin) = health.drive_begin else { continue };
            let Some(now) = health.drive_time else { continue };
            if self.written_ticks.insert(stage.to_owned(), health.ticks) == Some(health.ticks) {
                continue;
            }
            let drive_s = now.saturating_sub(begin) as f64 * 1e-9;
            let Health { ticks, usage: Usage { cpu_s, rss_bytes, .. }, .. } = health;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{wall_s:.3},{stage},{drive_s:.3},{ticks},{cpu_s:.3},{rss_bytes}");
        }
        text
    }
}

fn append(file: &Path, text: &str) -> std::io::Result<()> {
    let mut file = OpenOptions::new().create(true).append(true).open(file)?;
    let header = if file.metadata()?.len() == 0 { HEADER } else { "" };
    file.write_all(format!("{header}{text}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn health(ticks: u64) -> Health {
        let drive_time = Some(5_000_000_000 + ticks as i64 * 100_000_000);
        let cpu_s = ticks as f64 * 0.02;
        let rss_bytes = 50_000_000;
        Health {
            ticks,
            drive_begin: Some(5_000_000_000),
            drive_time,
            usage: Usage { cpu_s, rss_bytes, ..Usage::default() },
            ..Health::default()
        }
    }

    #[test]
    fn each_progress_adds_a_line_and_a_restart_continues_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("costs.csv");
        let mut costs = Costs::new(file.clone());
        let before = health(30);
        let idle = Health::default();
        let beats = [StageHealth { stage: "acquire", health: &before }, StageHealth { stage: "export", health: &idle }];
        for _ in 0..2 {
            costs.write(beats.iter().copied());
        }
        let after = health(31);
        Costs::new(file.clone()).write(std::iter::once(StageHealth { stage: "acquire", health: &after }));
        let text = std::fs::read_to_string(&file).expect("written");
        let rows: Vec<&str> = text.lines().map(|line| line.split_once(',').expect("columns").1).collect();
        let expected = ["acquire,3.000,30,0.600,50000000", "acquire,3.100,31,0.620,50000000"];
        assert_eq!(rows, [&["stage,drive_s,ticks,cpu_s,resident_bytes"], &expected[..]].concat(), "{text}");
    }

    #[test]
    fn unwritable_file_is_tolerated() {
        let mut costs = Costs::new(PathBuf::from("/nowhere/costs.csv"));
        costs.write(std::iter::once(StageHealth { stage: "acquire", health: &health(1) }));
        assert!(costs.has_failed);
    }
}
