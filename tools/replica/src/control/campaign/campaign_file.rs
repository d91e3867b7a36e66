//! `campaign.toml`: drives, launch file, and what follows after the drives.

use crate::control::batch::drives::BatchDrive;
use anyhow::Context;
use files::text_file::read_toml;
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Folder of the campaign's own files in its output.
pub const OWN_FOLDER: &str = "campaign";
/// Folder of the survey in the output.
pub const SURVEY: &str = "survey";
/// Folder of the deliveries in the output.
pub const DELIVERIES: &str = "deliveries";

/// The whole file. Paths are relative to its folder.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCampaign {
    version: u32,
    name: String,
    launch: PathBuf,
    drives: Vec<PathBuf>,
    out: PathBuf,
    #[serde(default)]
    set: Vec<String>,
    #[serde(default)]
    without: Vec<String>,
    #[serde(default)]
    slurm: SlurmOptions,
    survey: Option<SurveyOptions>,
    deliver: Option<DeliverOptions>,
}

/// Options of the jobs.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlurmOptions {
    /// Processors of a job; absent: the default of the partition.
    pub cpus: Option<u32>,
    /// Memory of a job, MB; absent: estimated from finished drives.
    pub memory_mb: Option<u32>,
    /// Time limit of a job, minutes; absent: estimated from finished drives.
    pub minutes: Option<u32>,
    /// Seconds before the time limit at which a run starts to drain.
    pub drain_s: Option<u32>,
    /// Drives that run at the same time; absent: as many as the cluster allows.
    pub at_once: Option<u32>,
    /// Further options of sbatch, for example `--partition=all`.
    pub options: Vec<String>,
}

/// Survey after the drives.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurveyOptions {
    /// The table `[points]` of survey.toml.
    pub points: Option<toml::Table>,
}

/// Delivery of each finished drive.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeliverOptions {
    /// Options of `replica deliver`.
    #[serde(default)]
    pub options: Vec<String>,
}

/// A checked campaign.
#[derive(Debug)]
pub struct Campaign {
    /// The file, absolute.
    pub file: PathBuf,
    /// Name of its jobs.
    pub name: String,
    /// The launch file, absolute.
    pub launch: PathBuf,
    /// The drives in the order of the file.
    pub drives: Vec<BatchDrive>,
    /// Folder of the results, absolute.
    pub out: PathBuf,
    /// Changes of the launch file.
    pub set: Vec<String>,
    /// Stages that are left out.
    pub without: Vec<String>,
    /// Options of the jobs.
    pub slurm: SlurmOptions,
    /// Survey after the drives.
    pub survey: Option<SurveyOptions>,
    /// Deliveries after the drives.
    pub deliver: Option<DeliverOptions>,
}

/// A campaign that is refused: all faults at once.
#[derive(Debug, thiserror::Error)]
#[error("{}", faults.join("\n"))]
pub struct CampaignError {
    /// File, key, value and rule of each.
    pub faults: Vec<String>,
}

impl Campaign {
    /// Reads the file. The error is a [`CampaignError`] if the file can be read.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let file = std::path::absolute(path).with_context(|| path.display().to_string())?;
        let place = || path.display().to_string();
        let raw: RawCampaign = match read_toml(path) {
            Err(files::text_file::ReadTomlError::Toml(error)) => {
                return Err(CampaignError { faults: vec![format!("{}: {error}", place())] }.into());
            }
            raw => raw.with_context(place)?,
        };
        let folder = file.parent().unwrap_or(Path::new("/"));
        let mut faults = raw.faults();
        let launch = folder.join(&raw.launch);
        if !launch.is_file() {
            faults.push(format!("launch: {}: is not a file", launch.display()));
        }
        let mut paths = Vec::new();
        for drive in &raw.drives {
            match expanded(&folder.join(drive)) {
                Ok(found) => paths.extend(found),
                Err(fault) => faults.push(format!("drives: {fault}")),
            }
        }
        let listed = BatchDrive::list(&paths, &folder.join(&raw.out));
        let drives = listed.unwrap_or_else(|errors| {
            faults.extend(errors.into_iter().map(|error| format!("drives: {error}")));
            Vec::new()
        });
        for drive in drives.iter().filter(|drive| [OWN_FOLDER, SURVEY, DELIVERIES].contains(&drive.name.as_str())) {
            faults.push(format!(
                "drives: {}: {:?} is a folder of the campaign; rename the drive",
                drive.path.display(),
                drive.name
            ));
        }
        if !faults.is_empty() {
            let faults = faults.into_iter().map(|fault| format!("{}: {fault}", place())).collect();
            return Err(CampaignError { faults }.into());
        }
        let out = drives
            .first()
            .and_then(|drive| drive.output.parent())
            .map_or_else(|| folder.join(&raw.out), Path::to_owned);
        let RawCampaign { name, set, without, slurm, survey, deliver, .. } = raw;
        Ok(Self { file, name, launch, drives, out, set, without, slurm, survey, deliver })
    }

    /// Folder of the campaign's own files.
    pub fn own_folder(&self) -> PathBuf {
        self.out.join(OWN_FOLDER)
    }

    /// Whether a job follows after the drives.
    pub fn has_finish(&self) -> bool {
        self.survey.is_some() || self.deliver.is_some()
    }
}

impl RawCampaign {
    /// The faults of all values except paths.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        if self.version != 1 {
            faults.push(format!("version: {}; must be 1", self.version));
        }
        let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.name.is_empty() || !self.name.chars().all(is_plain) {
            faults.push(format!("name: {:?}; must consist of letters, digits, - and _", self.name));
        }
        if self.drives.is_empty() {
            faults.push("drives: is empty; must name at least one drive".to_owned());
        }
        let numbers = [
            ("slurm.cpus", self.slurm.cpus),
            ("slurm.memory_mb", self.slurm.memory_mb),
            ("slurm.minutes", self.slurm.minutes),
            ("slurm.drain_s", self.slurm.drain_s),
            ("slurm.at_once", self.slurm.at_once),
        ];
        for (key, _) in numbers.iter().filter(|(_, value)| *value == Some(0)) {
            faults.push(format!("{key}: 0; must be at least 1"));
        }
        // SLURM reads a line up to a comment; a line break would end the option.
        for option in
            self.slurm.options.iter().filter(|option| !option.starts_with('-') || option.contains(['\n', '#']))
        {
            faults.push(format!("slurm.options: {option:?}; must start with - and contain neither line breaks nor #"));
        }
        faults
    }
}

/// The folders that `FOLDER/*` names, in the order of their names, or the path itself.
fn expanded(path: &Path) -> Result<Vec<PathBuf>, String> {
    if path.file_name().is_none_or(|name| name != "*") {
        return Ok(vec![path.to_owned()]);
    }
    let folder = path.parent().unwrap_or(Path::new("/"));
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut found: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
    found.sort();
    if found.is_empty() { Err(format!("{}: no folder", path.display())) } else { Ok(found) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(campaign: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a folder");
        for drive in ["drives/a", "drives/b", "more/b", "more/survey"] {
            std::fs::create_dir_all(folder.path().join(drive)).expect("made");
        }
        std::fs::write(folder.path().join("launch.toml"), "").expect("written");
        std::fs::write(folder.path().join("campaign.toml"), campaign).expect("written");
        folder
    }

    #[test]
    fn star_names_all_folders_in_order() {
        let text = "version = 1\nname = \"x\"\nlaunch = \"launch.toml\"\ndrives = [\"drives/*\"]\nout = \"out\"\n";
        let folder = folder(text);
        let campaign = Campaign::load(&folder.path().join("campaign.toml")).expect("sound");
        let names: Vec<&str> = campaign.drives.iter().map(|drive| drive.name.as_str()).collect();
        assert_eq!(names, ["a", "b"]);
        assert!(campaign.out.is_absolute() && campaign.own_folder().ends_with("out/campaign"));
    }

    #[test]
    fn all_faults_are_reported_at_once() {
        let text = "version = 2\nname = \"a b\"\nlaunch = \"absent.toml\"\nout = \"out\"\n\
                    drives = [\"drives/*\", \"drives/a\", \"more/b\", \"more/survey\", \"none/*\"]\n\
                    [slurm]\ncpus = 0\noptions = [\"partition\", \"--a\\n#SBATCH\"]\n";
        let folder = folder(text);
        let error = Campaign::load(&folder.path().join("campaign.toml")).expect_err("is refused");
        let CampaignError { faults } = error.downcast().expect("faults of the file");
        let rules = [
            "version: 2",
            "name: \"a b\"",
            "absent.toml: is not a file",
            "drives/a: is given twice",
            "would both write",
            "none: No such file",
            "slurm.cpus: 0",
            "\"partition\"; must start with -",
            "neither line breaks",
        ];
        for rule in rules {
            assert!(faults.iter().any(|fault| fault.contains(rule)), "{rule}: {faults:#?}");
        }
    }

    #[test]
    fn unknown_key_is_refused() {
        let folder = folder("version = 1\nname = \"x\"\nlaunch = \"launch.toml\"\ndrive = []\nout = \"out\"\n");
        let error = Campaign::load(&folder.path().join("campaign.toml")).expect_err("is refused");
        assert!(error.to_string().contains("unknown field `drive`"), "{error}");
    }
}
