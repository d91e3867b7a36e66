//! Compares colors and spectra of a run with the truth of its simulated town:
//! `cargo run --release -p studies --example color_truth -- [--keep-sky] TOWN SEED SECONDS RECORDING [SEED SECONDS RECORDING …]`.
//! `--keep-sky` colors without `reject_sky`.
//!
//! RECORDING contains the topics submap, trajectory, image and cube of a run on the drive that `replica simulate` writes for the
//! same town, seed and seconds with the vehicle of the thesis. Occlusion is reported with the flags of moving points that the run
//! estimated, and with the true ones. Colors and spectra are reported for static points.

mod score;
mod spectra;
mod town;

use crate::town::{Town, TrueExposure, TruePoint, with_true_flags};
use coloring::{
    AgeLimits, CHUNK, Candidates, Choices, Chunk, ColorImage, ColorSteps, PointBuffers, PointChoice, PosedExposure,
    ProjectionCamera, Sampler, SubmapPoints, visibility_maps,
};
use geometry::{Pose, RigCamera, Stamp};
use messages::{ClassId, ColorRow, SubmapHeader, SubmapPoint};
use rayon::prelude::*;
use score::{Score, Table, print_classes, print_colors, print_occlusion, print_spectra};
use simulation::sensors::camera::ColorCamera;
use simulation::sensors::exposure::Exposure;
use simulation::{DriveSpec, Simulation};
use std::error::Error;
use std::path::Path;
use studies::color_difference::difference;
use studies::recorded::Recorded;

/// Defaults of the stage.
const LIMITS: AgeLimits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
const MAX_AGE_NANOS: i64 = 1_000_000_000;
/// Largest share of the sky in a color that is not visible.
const MAX_SKY: f32 = 0.2;
/// One point in this many is compared with all cameras; coprime to the number of rings.
const STRIDE: usize = 23;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words: Vec<String> = std::env::args().skip(1).collect();
    let keeps_sky = words.first().is_some_and(|word| word == "--keep-sky");
    words.drain(..usize::from(keeps_sky));
    let [town_name, drives @ ..] = &words[..] else {
        return Err("usage: [--keep-sky] TOWN SEED SECONDS RECORDING …".into());
    };
    let steps = ColorSteps { level_exposures: true, reject_sky: !keeps_sky };
    let kind: simulation::Town = town_name.parse()?;
    let mut found = Table::default();
    let mut known = Table::default();
    let mut spectral: Vec<(String, Table)> = Vec::new();
    for drive in drives.chunks(3) {
        let [seed, seconds, recording] = drive else { return Err("each drive is SEED SECONDS RECORDING".into()) };
        let spec = DriveSpec { town: kind, ..DriveSpec::urban(seed.parse()?, seconds.parse()?) };
        let simulation = Simulation::new(&spec)?;
        let recorded = Recorded::open(Path::new(recording), true)?;
        let town = Town { simulation: &simulation, trajectory: &recorded.trajectory };
        for submap in &recorded.submaps {
            let header = submap.header();
            let odom_from_submap =
                header.odom_from_submap.to_pose().ok_or("submap: odom_from_submap is not a valid pose")?;
            let truth = town.points(header, &odom_from_submap, submap.rows());
            let n_moving = |moves: &dyn Fn(usize) -> bool| (0..truth.len()).filter(|i| moves(*i)).count();
            let moves = |i: usize| truth[i].is_some_and(|truth| truth.moves);
            let is_flagged = |i: usize| submap.rows()[i].flags != 0;
            println!(
                "seed {seed}, submap {}: {} points, {} on moving objects, {} flagged as moving, {} of these correctly",
                submap.seq(),
                truth.len(),
                n_moving(&moves),
                n_moving(&is_flagged),
                n_moving(&|i| moves(i) && is_flagged(i))
            );
            let part = Part { town: &town, recorded: &recorded, header, odom_from_submap, truth: &truth, steps };
            found = score::sum(found, part.colors(submap.rows())?);
            known = score::sum(known, part.colors(&with_true_flags(submap.rows(), &truth))?);
            spectral.resize_with(simulation.rig.mosaics.len(), Default::default);
            for (index, (name, table)) in spectral.iter_mut().enumerate() {
                name.clone_from(&simulation.rig.mosaics[index].name);
                *table = score::sum(std::mem::take(table), part.spectra(submap.rows(), index));
            }
        }
    }
    print_occlusion("With the flags that slam_aggregate estimated:", &found);
    print_occlusion("With the true flags:", &known);
    print_colors("Colors (estimated flags):", &found);
    print_classes("By class (estimated flags):", &found);
    for (name, table) in &spectral {
        print_spectra(&format!("Spectra of {name} (estimated flags), angles in rad:"), table);
    }
    Ok(())
}

/// A submap of a run.
pub struct Part<'a> {
    /// The town.
    pub town: &'a Town<'a>,
    /// The run.
    pub recorded: &'a Recorded,
    /// Header of the submap.
    pub header: &'a SubmapHeader,
    /// Pose of the submap, as the run estimated it.
    pub odom_from_submap: Pose,
    /// Truth of all points.
    pub truth: &'a [Option<TruePoint>],
    /// How points get their colors.
    pub steps: ColorSteps,
}

impl Part<'_> {
    /// Whether the stage would use an exposure.
    pub fn is_near(&self, stamp: i64) -> bool {
        let reach = self.header.stamp_begin - MAX_AGE_NANOS..=self.header.stamp_end + MAX_AGE_NANOS;
        reach.contains(&stamp) && self.recorded.trajectory.at(Stamp(stamp)).is_some()
    }

    /// Calls `add` for all sampled points with a known truth, with the exposure and pixel that give the point its color, or its
    /// spectrum if there are no images.
    pub fn tables(
        &self,
        points: &[SubmapPoint],
        exposures: &[PosedExposure<'_>],
        images: Option<&[ColorImage<'_>]>,
        add: impl Fn(&TruePoint, Option<(usize, [f32; 2])>, &mut Score) + Sync,
    ) -> Table {
        let sweeps = &self.header.sweeps[..self.header.n_sweeps as usize];
        let mut buffers = PointBuffers::default();
        let points =
            SubmapPoints::new(points, sweeps, self.header.stamp_begin, self.header.ring_counts(), &mut buffers);
        let visibility = &visibility_maps(&points, exposures);
        let candidates = Candidates { points: &points, exposures, visibility, limits: LIMITS };
        let sampler = images.map(|images| Sampler::new(&candidates, images, self.steps));
        let of_chunk = |(index, truth): (usize, &[Option<TruePoint>])| {
            let mut choices = Choices::default();
            let mut chunk = Chunk::default();
            points.read_chunk(index, &mut chunk);
            choices.choose(&chunk, &candidates);
            let mut chosen = vec![None; truth.len()];
            for choice in choices.chosen() {
                let PointChoice { i, exposure, pixel } = choice;
                let sampled =
                    |sampler: &Sampler<'_>| sampler.sample(&chunk, choice).map(|color| (color.exposure, color.pixel));
                chosen[i] = sampler.as_ref().map_or(Some((exposure, pixel)), sampled);
            }
            let mut table = Table::default();
            for (truth, chosen) in truth.iter().zip(chosen).step_by(STRIDE) {
                let Some(truth) = truth else { continue };
                let mut score = Score::default();
                add(truth, chosen, &mut score);
                table.add_point(truth.range_m, truth.class, score);
            }
            table
        };
        let parts: Vec<Table> = self.truth.par_chunks(CHUNK).enumerate().map(of_chunk).collect();
        parts.into_iter().fold(Table::default(), score::sum)
    }

    fn colors(&self, points: &[SubmapPoint]) -> Result<Table, Box<dyn Error>> {
        let specs = &self.town.simulation.rig.cameras;
        let cameras: Vec<ProjectionCamera> = (specs.iter())
            .map(|c| ProjectionCamera::from(&RigCamera { body_from_camera: c.body_from_camera, model: c.lens.clone() }))
            .collect();
        let color_cameras: Vec<ColorCamera> = specs.iter().map(|c| ColorCamera::new(&c.lens)).collect();
        let mut exposures = Vec::new();
        let mut true_exposures = Vec::new();
        let mut images = Vec::new();
        let mut rendered = Vec::new();
        for image in self.recorded.images.iter().filter(|image| self.is_near(image.stamp())) {
            let header = image.header();
            let camera = image.header().camera as usize;
            let Some(odom_from_body) = self.recorded.trajectory.at(Stamp(image.stamp())) else { continue };
            let pixels = ColorImage::new(header.camera as u8, header.width, header.height, image.rows());
            images.push(pixels.ok_or("image: number of bytes does not match width and height")?);
            exposures.push(cameras[camera].exposure(image.stamp(), &odom_from_body, &self.odom_from_submap));
            let body_from_camera = &specs[camera].body_from_camera;
            let lens = &specs[camera].lens;
            true_exposures.push(self.town.exposure(image.stamp(), body_from_camera, lens));
            rendered.push((&color_cameras[camera], self.town.simulation.color_exposure(camera, Stamp(image.stamp()))));
        }
        // Share of a color that comes from the sky.
        let sky_share = |exposure: usize, pixel: [f32; 2]| {
            let (camera, exposed): &(&ColorCamera, Exposure<'_>) = &rendered[exposure];
            let corners = images[exposure].corners(pixel);
            corners.map(|(at, share)| share as f32 / 65536.0 * camera.sky_share(exposed, at)).iter().sum::<f32>()
        };
        Ok(self.tables(points, &exposures, Some(&images), |truth, chosen, score| {
            let limit_s = if truth.moves { LIMITS.max_moving_age_s } else { LIMITS.max_age_s };
            let age_s = |exposure: &TrueExposure| (exposure.stamp - truth.stamp).unsigned_abs() as f64 * 1e-9;
            // Pixel of the true projection, if the exposure sees the point.
            let seen = |i: usize| {
                let pixel =
                    true_exposures[i].pixel(&truth.p).filter(|_| age_s(&true_exposures[i]) <= f64::from(limit_s))?;
                self.town.occluder(&true_exposures[i], &truth.p).is_none().then_some((i, pixel))
            };
            let mut by_age: Vec<usize> = (0..true_exposures.len()).collect();
            by_age.sort_by(|a, b| age_s(&true_exposures[*a]).total_cmp(&age_s(&true_exposures[*b])));
            let nearest = by_age.into_iter().find_map(seen);
            score.visible += usize::from(nearest.is_some());
            let is_solid = nearest.is_some() && truth.is_solid;
            score.solid += usize::from(is_solid);
            score.solid_colored += usize::from(is_solid && chosen.is_some());
            let Some((exposure, pixel)) = chosen else { return };
            score.visible_colored += usize::from(nearest.is_some());
            score.colored += 1;
            let occluder = self.town.occluder(&true_exposures[exposure], &truth.p);
            score.behind_leaves += usize::from(occluder == Some(ClassId::Vegetation));
            score.behind_solid += usize::from(occluder.is_some_and(|class| class != ClassId::Vegetation));
            score.of_sky += usize::from(sky_share(exposure, pixel) > MAX_SKY);
            if truth.moves {
                return;
            }
            // The chosen exposure if the point is really visible there; otherwise the nearest one that sees it.
            if let Some((true_exposure, true_pixel)) = seen(exposure).or(nearest) {
                let rgb = |row: ColorRow| [row.r, row.g, row.b];
                if sky_share(true_exposure, true_pixel) > MAX_SKY {
                    return;
                }
                let color = rgb(images[exposure].sample(pixel));
                let true_color = rgb(images[true_exposure].sample(true_pixel));
                score.color_differences.push(difference(color, true_color));
            }
        }))
    }
}
