//! Follows the output folder of a run: the phase of the run, and the clouds that it has written.

use crate::data::deliver::{SOFTWARE, SYSTEM};
use anyhow::Context;
use delivery::{CLOUDS, submap_of};
use formats::ply::PlyRows;
use run::summary::Summary;
use run::wiring::Wiring;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use surveying::{GrowingCloud, Part};

/// File written at the start of a run. Older clouds belong to an earlier run.
const BEGIN: &str = "run/settings.json";

/// Phase of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// No run is alive in the folder or has ended there.
    #[default]
    Waiting,
    Running,
    /// The final poses are known, and the clouds are moved to them.
    Moving,
    /// The run has written its summary: the final cloud can be shown.
    Finished,
    /// The supervisor ended without a summary. The run can be resumed.
    Interrupted,
}

/// `live.json`, which the page polls.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveState {
    pub phase: Phase,
    /// Outcome from the summary; empty before the summary exists.
    pub outcome: &'static str,
    /// Number of the run since the start of the viewer: the page starts over when it changes.
    pub run: u64,
    /// Bytes of the list of the parts.
    pub parts_bytes: u64,
}

/// A run whose clouds are thinned and copied into a file as soon as they are written.
pub struct LiveRun {
    output: PathBuf,
    /// Paths of the file of points and of the list of its parts, one JSON object per line.
    files: [PathBuf; 2],
    begun: Option<SystemTime>,
    growing: Option<GrowingCloud>,
    /// Submaps that are in the file, or were found in their final frame.
    seen: BTreeSet<u64>,
    has_moved_clouds: bool,
    state: LiveState,
}

impl LiveRun {
    /// Follows the run into `output`, which need not exist.
    pub fn new(output: &Path, points: PathBuf, parts: PathBuf) -> anyhow::Result<Self> {
        let mut this = Self {
            output: output.to_owned(),
            files: [points, parts],
            begun: None,
            growing: None,
            seen: BTreeSet::new(),
            has_moved_clouds: false,
            state: LiveState::default(),
        };
        this.begin(None)?;
        Ok(this)
    }

    /// Reads the folder. Returns the state for the page.
    pub fn update(&mut self) -> anyhow::Result<LiveState> {
        let begun = fs::metadata(self.output.join(BEGIN)).and_then(|file| file.modified()).ok();
        if begun != self.begun {
            self.begin(begun)?;
        }
        // The phase first: the clouds so far of a running run must not be mistaken for all clouds of a finished run.
        self.state.phase = self.phase();
        self.state.outcome = "";
        if self.state.phase == Phase::Finished
            && let Ok(summary) = Summary::load(&self.output)
        {
            self.state.outcome = summary.outcome.word();
        }
        self.add_clouds()?;
        if self.state.phase == Phase::Running && self.has_moved_clouds {
            self.state.phase = Phase::Moving;
        }
        Ok(self.state.clone())
    }

    /// Discards the previous run.
    fn begin(&mut self, begun: Option<SystemTime>) -> anyhow::Result<()> {
        for file in &self.files {
            fs::write(file, []).with_context(|| file.display().to_string())?;
        }
        self.seen.clear();
        self.begun = begun;
        self.growing = None;
        self.has_moved_clouds = false;
        // A page without points need not start over.
        let run = self.state.run + u64::from(self.state.parts_bytes > 0);
        self.state = LiveState { run, ..LiveState::default() };
        Ok(())
    }

    fn phase(&self) -> Phase {
        let is_alive = self
            .output
            .canonicalize()
            .is_ok_and(|output| Wiring::read(&output).is_ok_and(|wiring| wiring.is_alive(&output)));
        match (is_alive, self.begun) {
            (true, _) => Phase::Running,
            (false, _) if Summary::file(&self.output).exists() => Phase::Finished,
            (false, Some(_)) => Phase::Interrupted,
            (false, None) => Phase::Waiting,
        }
    }

    /// Copies the clouds that are new, in the order of the drive.
    fn add_clouds(&mut self) -> anyhow::Result<()> {
        let Some(begun) = self.begun else { return Ok(()) };
        let entries = fs::read_dir(self.output.join(CLOUDS)).into_iter().flatten().flatten();
        let mut clouds: Vec<(u64, PathBuf)> = entries
            .filter_map(|entry| Some((submap_of(&entry.file_name().to_string_lossy())?, entry)))
            .filter(|(seq, entry)| {
                let modified = || entry.metadata().and_then(|file| file.modified());
                !self.seen.contains(seq) && modified().is_ok_and(|modified| modified >= begun)
            })
            .map(|(seq, entry)| (seq, entry.path()))
            .collect();
        clouds.sort_unstable();
        for (seq, path) in clouds {
            // A cloud may be removed or replaced at any time, for example when a crashed run is resumed: the next update decides.
            let Ok(rows) = PlyRows::open(&path) else { continue };
            match self.add(seq, &rows)? {
                Some(part) => self.list(&part)?,
                None => self.has_moved_clouds = true,
            }
            self.seen.insert(seq);
        }
        Ok(())
    }

    fn add(&mut self, seq: u64, rows: &PlyRows) -> anyhow::Result<Option<Part>> {
        let growing = match &mut self.growing {
            Some(growing) => growing,
            None => self.growing.insert(GrowingCloud::create(&self.files[0], rows, SYSTEM, SOFTWARE)?),
        };
        Ok(growing.add(seq, rows)?)
    }

    /// Appends a part to the list, after its points are in the file.
    fn list(&mut self, part: &Part) -> anyhow::Result<()> {
        let line = serde_json::to_string(part)? + "\n";
        let path = &self.files[1];
        let file = fs::File::options().append(true).open(path);
        file.and_then(|mut file| file.write_all(line.as_bytes())).with_context(|| path.display().to_string())?;
        self.state.parts_bytes += line.len() as u64;
        Ok(())
    }
}
