//! Colors and spectra of a run against the truth of its town:
//! `cargo run --release -p colorize --example color_truth -- TOWN SEED SECONDS RECORDING [SEED SECONDS RECORDING …]`.
//!
//! RECORDING has the topics submap, trajectory, image and cube of a run on the drive that `replica simulate` makes with the
//! same town, seed and seconds and the thesis' vehicle. Tables of what is hidden come with the flags of moving things that the
//! run found and with the true ones; those of colors and spectra are of points that stand still.

mod lab;
#[path = "../common/recorded.rs"]
mod recorded;
mod score;
mod spectra;
mod town;

use colorize::choose::{Choices, Limits, Sources, View};
use colorize::chunk::{CHUNK, Chunk};
use colorize::cloud::{Cloud, Memory};
use colorize::color::Picture;
use colorize::occlusion::sights;
use colorize::views::Camera;
use geometry::{Pose, RigCamera, Stamp};
use messages::{ClassId, ColorRow, SubmapHeader, SubmapPoint};
use rayon::prelude::*;
use recorded::Recorded;
use score::{Table, at_range, print_colors, print_occlusion, print_spectra};
use simulation::{DriveSpec, Simulation};
use std::error::Error;
use std::path::Path;
use town::{Town, TrueExposure, TruePoint, with_true_flags};

/// Defaults of the stage.
const LIMITS: Limits = Limits { max_age_s: 1.0, max_moving_age_s: 0.1 };
const MAX_AGE_NANOS: i64 = 1_000_000_000;
/// Every so manyth point is looked at by all cameras; prime to the number of rings.
const STRIDE: usize = 23;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [town_name, drives @ ..] = &words[..] else { return Err("usage: TOWN SEED SECONDS RECORDING …".into()) };
    let kind = (simulation::Town::ALL.into_iter().find(|town| town.name() == town_name))
        .ok_or_else(|| format!("{town_name} is no kind of town"))?;
    let (mut found, mut known) = (Table::default(), Table::default());
    let mut spectral: Vec<(String, Table)> = Vec::new();
    for drive in drives.chunks(3) {
        let [seed, seconds, recording] = drive else { return Err("each drive is SEED SECONDS RECORDING".into()) };
        let spec = DriveSpec { town: kind, ..DriveSpec::urban(seed.parse()?, seconds.parse()?) };
        let simulation = Simulation::new(&spec)?;
        let recorded = Recorded::open(Path::new(recording), true)?;
        let town = Town { simulation: &simulation, trajectory: &recorded.trajectory };
        for submap in &recorded.submaps {
            let header = submap.header();
            let world_from_submap = header.world_from_submap.to_pose().ok_or("a submap's pose is no pose")?;
            let truth = town.points(header, &world_from_submap, submap.rows());
            let n_moving = |moves: &dyn Fn(usize) -> bool| (0..truth.len()).filter(|i| moves(*i)).count();
            let moves = |i: usize| truth[i].is_some_and(|truth| truth.moves);
            let is_flagged = |i: usize| submap.rows()[i].flags != 0;
            println!(
                "seed {seed}, submap {}: {} points, {} on moving things, {} flagged, {} of them rightly",
                submap.seq(),
                truth.len(),
                n_moving(&moves),
                n_moving(&is_flagged),
                n_moving(&|i| moves(i) && is_flagged(i))
            );
            let part = Part { town: &town, recorded: &recorded, header, world_from_submap, truth: &truth };
            found = score::sum(found, part.colors(submap.rows())?);
            known = score::sum(known, part.colors(&with_true_flags(submap.rows(), &truth))?);
            spectral.resize_with(simulation.rig.mosaics.len(), Default::default);
            for (index, (name, table)) in spectral.iter_mut().enumerate() {
                name.clone_from(&simulation.rig.mosaics[index].name);
                *table = score::sum(std::mem::take(table), part.spectra(submap.rows(), index));
            }
        }
    }
    print_occlusion("With the flags that slam_aggregate found:", &found);
    print_occlusion("With the true flags:", &known);
    print_colors("Colors (flags as found):", &found);
    for (name, table) in &spectral {
        print_spectra(&format!("Spectra of {name} (flags as found), angles in rad:"), table);
    }
    Ok(())
}

/// A submap of a run.
pub struct Part<'a> {
    /// Its town.
    pub town: &'a Town<'a>,
    /// The run.
    pub recorded: &'a Recorded,
    /// The submap's.
    pub header: &'a SubmapHeader,
    /// As the run has it.
    pub world_from_submap: Pose,
    /// Of all points.
    pub truth: &'a [Option<TruePoint>],
}

impl Part<'_> {
    /// Whether the stage would look at an exposure.
    pub fn is_near(&self, stamp: i64) -> bool {
        let reach = self.header.stamp_begin - MAX_AGE_NANOS..=self.header.stamp_end + MAX_AGE_NANOS;
        reach.contains(&stamp) && self.recorded.trajectory.at(Stamp(stamp)).is_some()
    }

    /// For all sampled points that are known, with the view and the pixel that were chosen for each.
    pub fn tables(
        &self,
        points: &[SubmapPoint],
        views: &[View<'_>],
        look: impl Fn(&TruePoint, Option<(usize, [f32; 2])>, &mut score::Score) + Sync,
    ) -> Table {
        let sweeps = &self.header.sweeps[..self.header.n_sweeps as usize];
        let mut memory = Memory::default();
        let cloud = Cloud::new(points, sweeps, self.header.stamp_begin, self.header.n_rings, &mut memory);
        let sights = sights(&cloud, views);
        let sources = Sources { cloud: &cloud, views, sights: &sights, limits: LIMITS };
        let of_chunk = |(chunk, truth): (&Chunk, &[Option<TruePoint>])| {
            let mut choices = Choices::default();
            choices.fill(chunk, &sources);
            let mut chosen = vec![None; truth.len()];
            choices.seen().for_each(|(i, view, pixel)| chosen[i] = Some((view, pixel)));
            let mut table = Table::default();
            for (truth, chosen) in truth.iter().zip(chosen).step_by(STRIDE) {
                let Some(truth) = truth else { continue };
                if let Some(score) = at_range(&mut table, truth.range_m) {
                    look(truth, chosen, score);
                }
            }
            table
        };
        let parts: Vec<Table> = cloud.chunks().par_iter().zip(self.truth.par_chunks(CHUNK)).map(of_chunk).collect();
        parts.into_iter().fold(Table::default(), score::sum)
    }

    fn colors(&self, points: &[SubmapPoint]) -> Result<Table, Box<dyn Error>> {
        let specs = &self.town.simulation.rig.cameras;
        let cameras: Vec<Camera> = (specs.iter())
            .map(|c| Camera::from(&RigCamera { body_from_camera: c.body_from_camera, model: c.lens.clone() }))
            .collect();
        let (mut views, mut exposures, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        for image in self.recorded.images.iter().filter(|image| self.is_near(image.stamp())) {
            let (header, camera) = (image.header(), image.header().camera as usize);
            let Some(world_from_body) = self.recorded.trajectory.at(Stamp(image.stamp())) else { continue };
            let picture = Picture::new(header.camera as u8, header.width, header.height, image.rows());
            pictures.push(picture.ok_or("an image does not have its size")?);
            views.push(cameras[camera].view(image.stamp(), &world_from_body, &self.world_from_submap));
            let (body_from_camera, lens) = (&specs[camera].body_from_camera, &specs[camera].lens);
            exposures.push(self.town.exposure(image.stamp(), body_from_camera, lens));
        }
        Ok(self.tables(points, &views, |truth, chosen, score| {
            let limit_s = if truth.moves { LIMITS.max_moving_age_s } else { LIMITS.max_age_s };
            let age_s = |exposure: &TrueExposure| (exposure.stamp - truth.stamp).unsigned_abs() as f64 * 1e-9;
            // Pixel of the true projection, if the exposure sees the point.
            let seen = |i: usize| {
                let pixel = exposures[i].pixel(&truth.p).filter(|_| age_s(&exposures[i]) <= f64::from(limit_s))?;
                self.town.before(&exposures[i], &truth.p).is_none().then_some((i, pixel))
            };
            let mut by_age: Vec<usize> = (0..exposures.len()).collect();
            by_age.sort_by(|a, b| age_s(&exposures[*a]).total_cmp(&age_s(&exposures[*b])));
            let nearest = by_age.into_iter().find_map(seen);
            score.visible += usize::from(nearest.is_some());
            let is_solid = nearest.is_some() && truth.is_solid;
            score.solid += usize::from(is_solid);
            score.solid_colored += usize::from(is_solid && chosen.is_some());
            let Some((view, pixel)) = chosen else { return };
            score.visible_colored += usize::from(nearest.is_some());
            score.colored += 1;
            let before = self.town.before(&exposures[view], &truth.p);
            score.behind_leaves += usize::from(before == Some(ClassId::Vegetation));
            score.behind_solid += usize::from(before.is_some_and(|class| class != ClassId::Vegetation));
            if truth.moves {
                return;
            }
            // The chosen exposure where the point is really seen on it; else the nearest that sees it.
            if let Some((place, true_pixel)) = seen(view).or(nearest) {
                let rgb = |row: ColorRow| [row.r, row.g, row.b];
                let color = rgb(pictures[view].sample(pixel));
                let true_color = rgb(pictures[place].sample(true_pixel));
                score.color_differences.push(lab::difference(color, true_color));
            }
        }))
    }
}
