//! Spectra that the mosaic cameras of simulated drives measure, with the true surface of each point.

use anyhow::Context;
use color_lines::{CubeSettings, Settings, Start};
use command_line::say_error;
use materials::Spectra;
use messages::MaterialId;
use town::Material;
use town_sweeps::{MosaicCameras, Mount, TownDrive, TownSubmap, TrueSurface, town_from_name, true_surfaces};

/// The simulated drives.
#[derive(Clone, Debug, clap::Args)]
pub struct TownArgs {
    /// Kinds of simulated town
    #[arg(long, value_name = "TOWN", value_delimiter = ',', default_value = "urban,suburban,rural")]
    towns: Vec<String>,
    /// Seeds of the drives through each kind of town
    #[arg(long, value_delimiter = ',', required = true)]
    seeds: Vec<u64>,
    /// Length of each drive, s
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
    /// Submaps of each drive, evenly distributed
    #[arg(long, default_value_t = 4)]
    submaps: usize,
    /// Sweeps of each submap
    #[arg(long, default_value_t = 5)]
    sweeps: usize,
    /// Smooth the cubes, as `[calibrate] median` does
    #[arg(long)]
    median: bool,
}

/// A submap with its spectra.
pub struct TownSpectra {
    /// All points, and the true class of each.
    pub submap: TownSubmap,
    /// Index of the point of each spectrum.
    pub points: Vec<u32>,
    /// The spectra.
    pub spectra: Spectra,
    /// The region of the point of each spectrum in the cubes, 0 = none.
    pub regions: Vec<u32>,
    /// The true surface of the point of each spectrum; `None` for mixed returns.
    pub surfaces: Vec<Option<TrueSurface>>,
}

impl TownArgs {
    /// Description of the source of a model.
    pub fn description(&self) -> String {
        let seeds: Vec<String> = self.seeds.iter().map(u64::to_string).collect();
        format!("simulated drives through {} towns, seeds {}", self.towns.join(", "), seeds.join(", "))
    }

    /// Simulates the submaps one after another. Without `has_regions`, all regions are 0.
    pub fn for_each(
        &self,
        has_regions: bool,
        mut take: impl FnMut(&TownSpectra) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        // The defaults of `[calibrate]`, with one model for a submap.
        let model = Settings { start: Start::Count(60), ..Settings::default() };
        let color_lines = has_regions.then_some(CubeSettings { model, frames_per_model: u32::MAX, simplifies: false });
        for name in &self.towns {
            let town = town_from_name(name)?;
            for &seed in &self.seeds {
                let drive = TownDrive { town, seed, seconds: self.seconds };
                let simulation = drive.simulation()?;
                let cameras = MosaicCameras::new(&simulation, self.median)?;
                let mut n_spectra = 0;
                for submap in drive.submaps_in(&simulation, self.submaps, self.sweeps, 1, Mount::Rig)? {
                    let found = cameras.spectra(&simulation, &submap.header, &submap.points, color_lines.as_ref())?;
                    let (points, spectra) = Spectra::from_column(&found.header, &found.rows)
                        .context("a column of spectra does not fit its header")?;
                    let shown: Vec<usize> = points.iter().map(|point| *point as usize).collect();
                    let surfaces = true_surfaces(&simulation, &submap.header, &submap.points, &shown);
                    n_spectra += spectra.len();
                    let regions = shown.iter().map(|point| found.regions[*point]).collect();
                    take(&TownSpectra { submap, points, spectra, regions, surfaces })?;
                }
                say_error!("{name} {seed}: {n_spectra} spectra");
            }
        }
        Ok(())
    }
}

impl TownSpectra {
    /// Positions of the points of the spectra, m, in the frame of the submap.
    pub fn positions(&self) -> Vec<[f32; 3]> {
        let position = |point: &u32| {
            let point = &self.submap.points[*point as usize];
            [point.x, point.y, point.z]
        };
        self.points.iter().map(position).collect()
    }

    /// Distance of the point of a spectrum from the LiDAR, m.
    pub fn range_m(&self, index: usize) -> f32 {
        let point = &self.submap.points[self.points[index] as usize];
        let [x, y, z, ..] = self.submap.header.sweeps[usize::from(point.sweep_idx)].submap_from_lidar_begin;
        let [x, y, z] = [point.x - x, point.y - y, point.z - z];
        (x * x + y * y + z * z).sqrt()
    }
}

/// Whether a surface of the towns is held out: every third surface of each material. The others suffice for a model; the held-out
/// surfaces measure how it generalizes.
pub fn is_held_out(material: Material) -> bool {
    let Some(id) = material.id() else { return true };
    number_of(material, id) % 3 == 2
}

/// Number of a surface among the surfaces of its material.
fn number_of(material: Material, id: MaterialId) -> usize {
    Material::ALL.iter().filter(|other| other.id() == Some(id)).take_while(|other| **other != material).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_the_surfaces_is_held_out_and_every_material_keeps_one() {
        let n_held_out = Material::ALL.iter().filter(|material| is_held_out(**material)).count();
        assert!((20..50).contains(&n_held_out), "{n_held_out}");
        for id in MaterialId::ALL.iter().skip(1) {
            let known = |material: &&Material| material.id() == Some(*id) && !is_held_out(**material);
            assert!(Material::ALL.iter().any(|material| known(&material)), "{id:?}");
        }
    }
}
