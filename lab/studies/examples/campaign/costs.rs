//! Costs of finished runs, from their output folders.

use anyhow::Context;
use run::Outcome;
use run::summary::Summary;
use std::path::Path;

/// What a run took. Counts are numbers with a fraction, because means of runs have the same form.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunCosts {
    /// Name of its folder.
    pub name: String,
    /// Length of its path, km.
    pub km: f64,
    /// Drive time, s.
    pub drive_s: f64,
    /// Time on its machine, s.
    pub wall_s: f64,
    /// Processor time of all stages, s.
    pub cpu_s: f64,
    /// Shared memory and private memory of all stages at their peaks, bytes.
    pub memory_bytes: f64,
    /// Bytes that the first stage read.
    pub read_bytes: f64,
    /// Bytes of its folder.
    pub disk_bytes: f64,
    /// Files of its folder.
    pub n_files: f64,
}

impl RunCosts {
    /// Costs of a longer or shorter drive through the same street: everything but the memory is proportional to its time.
    pub fn scaled_to(&self, drive_s: f64) -> Self {
        let factor = drive_s / self.drive_s;
        Self {
            name: self.name.clone(),
            km: self.km * factor,
            drive_s,
            wall_s: self.wall_s * factor,
            cpu_s: self.cpu_s * factor,
            memory_bytes: self.memory_bytes,
            read_bytes: self.read_bytes * factor,
            disk_bytes: self.disk_bytes * factor,
            n_files: self.n_files * factor,
        }
    }
}

/// The finished runs in a folder, in the order of their names.
pub fn read(out: &Path) -> anyhow::Result<Vec<RunCosts>> {
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(out).with_context(|| out.display().to_string())? {
        let path = entry?.path();
        if Summary::file(&path).is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    let mut runs = Vec::new();
    for folder in folders {
        let summary = Summary::load(&folder)?;
        if summary.outcome == Outcome::Done {
            runs.push(costs(&folder, &summary)?);
        }
    }
    anyhow::ensure!(!runs.is_empty(), "{}: no folder in it has the summary.json of a finished run", out.display());
    Ok(runs)
}

/// The mean of each figure.
pub fn mean(runs: &[RunCosts]) -> RunCosts {
    let mean = |figure: fn(&RunCosts) -> f64| runs.iter().map(figure).sum::<f64>() / runs.len() as f64;
    RunCosts {
        name: "mean".to_owned(),
        km: mean(|run| run.km),
        drive_s: mean(|run| run.drive_s),
        wall_s: mean(|run| run.wall_s),
        cpu_s: mean(|run| run.cpu_s),
        memory_bytes: mean(|run| run.memory_bytes),
        read_bytes: mean(|run| run.read_bytes),
        disk_bytes: mean(|run| run.disk_bytes),
        n_files: mean(|run| run.n_files),
    }
}

fn costs(folder: &Path, summary: &Summary) -> anyhow::Result<RunCosts> {
    let private: u64 = summary.stages.iter().map(|stage| stage.peak_private_bytes).sum();
    let size = folder_size(folder)?;
    Ok(RunCosts {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        km: path_km(&folder.join("trajectory.txt"))?,
        drive_s: summary.total.drive_s,
        wall_s: summary.total.wall_s,
        cpu_s: summary.total.cpu_s,
        memory_bytes: (summary.total.peak_shared_memory_bytes + private) as f64,
        read_bytes: summary.stages.first().map_or(0.0, |source| source.read_bytes as f64),
        disk_bytes: size.bytes as f64,
        n_files: size.n_files as f64,
    })
}

/// Length of a path of lines `time x y z ...`, km.
fn path_km(file: &Path) -> anyhow::Result<f64> {
    let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
    let mut metres = 0.0;
    let mut last: Option<[f64; 3]> = None;
    for (index, line) in text.lines().enumerate() {
        let place = || format!("{}:{}", file.display(), index + 1);
        let values: Result<Vec<f64>, _> = line.split_whitespace().skip(1).take(3).map(str::parse).collect();
        let position: [f64; 3] = values.with_context(place)?.try_into().ok().with_context(place)?;
        if let Some(last) = last {
            metres += (0..3).map(|axis| (position[axis] - last[axis]).powi(2)).sum::<f64>().sqrt();
        }
        last = Some(position);
    }
    Ok(metres / 1000.0)
}

#[derive(Default)]
struct FolderSize {
    bytes: u64,
    n_files: u64,
}

fn folder_size(folder: &Path) -> anyhow::Result<FolderSize> {
    let mut size = FolderSize::default();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let entry = entry?;
            let kind = entry.file_type()?;
            if kind.is_dir() {
                folders.push(entry.path());
            } else if kind.is_file() {
                size.bytes += entry.metadata()?.len();
                size.n_files += 1;
            }
        }
    }
    Ok(size)
}
