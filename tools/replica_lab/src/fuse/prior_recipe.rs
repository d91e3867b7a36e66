//! Recipes of priors: the simulated drives that they are fitted to.

use crate::train::recipe_data::{Range, named_mounts};
use anyhow::Context;
use command_line::say_error;
use files::text_file::read_toml;
use messages::ClassId;
use segmentation::intensity::IntensityUse;
use segmentation::{Fused, Fusion, ModelInput, Options, Refinement};
use serde::Deserialize;
use std::path::Path;
use town_sweeps::{TownDrive, TownSubmap, town_from_name};
use training::LabeledMeans;

/// One point in this many counts: the points between lie on the same objects.
const STEP: usize = 16;
/// Revolutions per second of all simulated LiDARs.
const TURNS_PER_SECOND: f64 = 10.0;

/// A recipe: groups of drives, each with one mean IoU.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PriorRecipe {
    group: Vec<Group>,
}

/// Simulated drives: each kind of town with each seed and each LiDAR.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Group {
    towns: Vec<String>,
    seeds: Range,
    /// Sensors, as in `replica-lab evaluate classes --sensor`.
    sensors: Vec<String>,
    /// Use of intensities, as in `replica-lab evaluate classes --intensity`.
    intensity: IntensityUse,
    seconds: f64,
    submaps: usize,
    sweeps: usize,
}

/// Means of two models.
pub struct MeansByGroup {
    /// Classes of the models.
    pub classes: Vec<ClassId>,
    /// Means of the points with one of these classes, by group.
    pub groups: Vec<LabeledMeans>,
}

impl PriorRecipe {
    /// Reads and checks a recipe.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let recipe: Self = read_toml(path).with_context(|| path.display().to_string())?;
        anyhow::ensure!(!recipe.group.is_empty(), "{}: has no group", path.display());
        for (number, group) in (1..).zip(&recipe.group) {
            group.check().with_context(|| format!("{}: group {number}", path.display()))?;
        }
        Ok(recipe)
    }
    /// The means of the points of all groups.
    pub fn means(&self, first: &Path, second: &Path, fusion: &Fusion) -> anyhow::Result<MeansByGroup> {
        let mut classes = Vec::new();
        let mut groups = Vec::new();
        for group in &self.group {
            let options = Options { intensity: group.intensity, refinement: Refinement::NONE, ..Options::default() };
            let fused = Fused::read(first, second, fusion, &options)?;
            groups.push(group.means(&fused)?);
            classes = fused.classes().to_vec();
        }
        Ok(MeansByGroup { classes, groups })
    }
}

impl Group {
    fn check(&self) -> anyhow::Result<()> {
        for town in &self.towns {
            town_from_name(town)?;
        }
        named_mounts(&self.sensors)?;
        anyhow::ensure!(!self.towns.is_empty() && !self.sensors.is_empty(), "towns and sensors must not be empty");
        let Range { first, last } = self.seeds;
        anyhow::ensure!(first <= last, "seeds: first = {first} is above last = {last}");
        anyhow::ensure!(self.submaps > 0 && self.sweeps > 0, "submaps and sweeps must be at least 1");
        let Self { sweeps, seconds, .. } = self;
        // False for NaN.
        let is_long_enough = *seconds >= *sweeps as f64 / TURNS_PER_SECOND;
        anyhow::ensure!(is_long_enough, "{sweeps} sweeps do not fit in seconds = {seconds}: each takes 0.1 s");
        Ok(())
    }
    fn means(&self, fused: &Fused) -> anyhow::Result<LabeledMeans> {
        let mut means = LabeledMeans::default();
        for name in &self.towns {
            let town = town_from_name(name)?;
            for seed in self.seeds.iter() {
                let drive = TownDrive { town, seed, seconds: self.seconds };
                let simulation = drive.simulation()?;
                for mount in named_mounts(&self.sensors)? {
                    for submap in drive.submaps_in(&simulation, self.submaps, self.sweeps, 1, mount)? {
                        add(&mut means, fused, &submap)?;
                    }
                }
                say_error!("{name}-{seed}");
            }
        }
        Ok(means)
    }
}

fn add(means: &mut LabeledMeans, fused: &Fused, submap: &TownSubmap) -> anyhow::Result<()> {
    let TownSubmap { header, points, truth } = submap;
    let classes = fused.classes();
    let rows = fused.means(&ModelInput::new(header, points), STEP)?;
    for (row, class) in rows.chunks_exact(classes.len()).zip(truth.iter().step_by(STEP)) {
        let number = classes.iter().position(|known| *known as u8 == *class);
        // Zeros are points that neither model can classify.
        if let Some(number) = number.filter(|_| row[0] > 0.0) {
            means.push(row, number as u8);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GROUP: &str = "[[group]]\ntowns = ['urban']\nseeds = { first = 1, last = 2 }\nsensors = ['rig']\nintensity = 'off'\n\
                         seconds = 2.0\nsubmaps = 1\nsweeps = 1\n";

    #[test]
    fn shipped_recipe_is_accepted_and_has_no_published_or_trained_seeds() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models/street_fused.toml");
        let recipe = PriorRecipe::load(&path).expect("is right");
        let seeds = || recipe.group.iter().flat_map(|group| group.seeds.iter());
        assert!(seeds().count() > 0 && seeds().all(|seed| (5000..9000).contains(&seed)));
    }

    #[test]
    fn faulty_group_is_refused_by_file_number_and_value() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("recipe.toml");
        for (right, wrong, rule) in [
            ("'urban'", "'moon'", "moon"),
            ("'rig'", "'radar'", "unknown sensor \"radar\", must be one of rig, kitti"),
            ("['rig']", "[]", "towns and sensors must not be empty"),
            ("first = 1", "first = 3", "seeds: first = 3 is above last = 2"),
            ("submaps = 1", "submaps = 0", "submaps and sweeps must be at least 1"),
            ("sweeps = 1", "sweeps = 21", "21 sweeps do not fit in seconds = 2: each takes 0.1 s"),
            ("seconds = 2.0", "seconds = nan", "1 sweeps do not fit in seconds = NaN"),
        ] {
            std::fs::write(&path, [GROUP, &GROUP.replace(right, wrong)].concat()).expect("writes");
            let error = format!("{:#}", PriorRecipe::load(&path).expect_err("is refused"));
            assert!(error.contains("recipe.toml: group 2: ") && error.contains(rule), "{error}");
        }
        std::fs::write(&path, [GROUP, &GROUP.replace("'off'", "'of'")].concat()).expect("writes");
        let error = format!("{:#}", PriorRecipe::load(&path).expect_err("is refused"));
        assert!(error.contains("recipe.toml: TOML parse error at line 13"), "{error}");
        assert!(error.contains("value \"of\" must be one of auto, normalized, raw, off"), "{error}");
        std::fs::write(&path, "group = []").expect("writes");
        let error = PriorRecipe::load(&path).expect_err("is refused").to_string();
        assert!(error.contains("recipe.toml: has no group"), "{error}");
    }
}
