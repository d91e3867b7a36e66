//! Labeled submaps of the sources of a recipe, for networks on images and on points.

use super::camera_columns::CameraNeeds;
use super::ideal_columns::IdealCameras;
use super::recipe_data::{Data, Range};
use rayon::prelude::*;
use segmentation::ModelInput;
use town_sweeps::{TownDrive, TownSubmap};

/// A submap in which each point has a class id.
pub struct Labeled<'a> {
    /// Points, and the columns of the cameras that the features of the recipe need.
    pub input: ModelInput<'a>,
    pub classes: &'a [u8],
}

/// Simulates drives. `convert` runs in parallel on each submap; `push` receives the results in order. Calls `progress` with the number
/// of finished drives and of all drives.
pub fn simulate<T: Send>(
    data: &Data,
    seeds: Range,
    needs: &CameraNeeds,
    convert: impl Fn(Labeled<'_>) -> anyhow::Result<T> + Sync,
    mut push: impl FnMut(T) -> anyhow::Result<()>,
    progress: &mut dyn FnMut(usize, usize),
) -> anyhow::Result<()> {
    let towns = data.towns()?;
    let mounts = data.mounts()?;
    let cameras = IdealCameras::new(needs);
    let seeds: Vec<u64> = seeds.iter().collect();
    let of_drive = |seed: &u64| -> anyhow::Result<Vec<T>> {
        let n_towns = towns.len() as u64;
        let town = towns[(*seed % n_towns) as usize];
        let mount = mounts[(*seed / n_towns % mounts.len() as u64) as usize];
        let drive = TownDrive { town, seed: *seed, seconds: data.seconds };
        let simulation = drive.simulation()?;
        let submaps = drive.submaps_in(&simulation, data.submaps, data.sweeps, data.stride, mount)?;
        let of_submap = |submap: &TownSubmap| {
            let columns = cameras.columns(&simulation, submap);
            convert(Labeled { input: columns.input(&submap.header, &submap.points), classes: &submap.truth })
        };
        submaps.iter().map(of_submap).collect()
    };
    // A few drives at a time, so that the memory does not grow with the number of drives.
    let at_a_time = rayon::current_num_threads();
    for (n_done, seeds_of_step) in seeds.chunks(at_a_time).enumerate() {
        let drives: Vec<anyhow::Result<Vec<T>>> = seeds_of_step.par_iter().map(of_drive).collect();
        drives.into_iter().collect::<anyhow::Result<Vec<_>>>()?.into_iter().flatten().try_for_each(&mut push)?;
        progress(n_done * at_a_time + seeds_of_step.len(), seeds.len());
    }
    Ok(())
}
