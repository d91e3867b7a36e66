//! Measures how much colors change where one exposure ends and the next begins, with and without leveling:
//! `cargo run --release -p studies --example color_seams -- STOPS DRIVE RECORDING [DRIVE RECORDING …]`.
//!
//! STOPS is a planted error: each exposure is made brighter or darker by up to this many stops, as by cameras with automatic
//! exposure.
//!
//! RECORDING contains the topics submap, trajectory and image of a run on DRIVE. The example compares neighbors on a ring, at most
//! 0.1 m apart. Pairs within one exposure show the texture of the street. Pairs of two exposures show the border in addition: it is
//! caused by the choice if both exposures see both points, otherwise by occlusion. Points that do not contribute to the gains show
//! how differently two exposures depict the same surface.

use coloring::{
    AgeLimits, CHUNK, Candidates, Choices, Chunk, ColorImage, ColorSteps, ExposureGains, PointBuffers, PointChoice,
    PointColor, PosedExposure, ProjectionCamera, Sampler, SubmapPoints, color_into, overlaps, visibility_maps,
};
use drive::Drive;
use geometry::Stamp;
use messages::{ColorRow, SubmapPoint};
use std::error::Error;
use std::path::Path;
use std::time::Instant;
use studies::color_difference;
use studies::recorded::Recorded;

/// Defaults of the stage.
const LIMITS: AgeLimits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
const MAX_AGE_NANOS: i64 = 1_000_000_000;

/// Color differences (dE) of pairs, each as recorded and leveled.
#[derive(Default)]
struct Sums {
    within: [Vec<f64>; 2],
    border: [Vec<f64>; 2],
    hidden: [Vec<f64>; 2],
    twice: [Vec<f64>; 2],
    n_points: usize,
    n_other: usize,
    seconds: [f64; 2],
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [stops, words @ ..] = &words[..] else { return Err("usage: STOPS DRIVE RECORDING …".into()) };
    let stops: f64 = stops.parse()?;
    let mut sums = Sums::default();
    for pair in words.chunks(2) {
        let [drive, recording] = pair else { return Err("usage: STOPS DRIVE RECORDING …".into()) };
        add(&mut sums, stops, &Drive::open(Path::new(drive))?, &Recorded::open(Path::new(recording), false)?)?;
    }
    println!("| dE | pairs | as recorded: mean, median | leveled: mean, median |");
    for (name, [plain, level]) in [
        ("within an exposure", &sums.within),
        ("across a border, both visible in both", &sums.border),
        ("across a border, one occluded", &sums.hidden),
        ("one point, two exposures", &sums.twice),
    ] {
        let [a, b] = [plain, level].map(|values| (mean(values), median(values)));
        println!("| {name} | {} | {:.2}, {:.2} | {:.2}, {:.2} |", plain.len(), a.0, a.1, b.0, b.1);
    }
    let [plain, level] = sums.seconds;
    println!("{} colored points, {} from another exposure", sums.n_points, sums.n_other);
    println!("occlusion and color: {plain:.3} s as recorded, {level:.3} s leveled (minimum of 5, one thread)");
    Ok(())
}

fn add(sums: &mut Sums, stops: f64, drive: &Drive, recorded: &Recorded) -> Result<(), Box<dyn Error>> {
    let cameras: Vec<ProjectionCamera> = drive.rig().cameras.iter().map(ProjectionCamera::from).collect();
    let bytes: Vec<Vec<u8>> =
        recorded.images.iter().enumerate().map(|(i, image)| brighter(image.rows(), stops, i)).collect();
    for submap in &recorded.submaps {
        let header = submap.header();
        let odom_from_submap =
            header.odom_from_submap.to_pose().ok_or("submap: odom_from_submap is not a valid pose")?;
        let reach = header.stamp_begin - MAX_AGE_NANOS..=header.stamp_end + MAX_AGE_NANOS;
        let mut exposures: Vec<PosedExposure<'_>> = Vec::new();
        let mut images: Vec<ColorImage<'_>> = Vec::new();
        for (image, bytes) in recorded.images.iter().zip(&bytes).filter(|(image, _)| reach.contains(&image.stamp())) {
            let header = image.header();
            let camera = image.header().camera as usize;
            let Some(odom_from_body) = recorded.trajectory.at(Stamp(image.stamp())) else { continue };
            exposures.push(cameras[camera].exposure(image.stamp(), &odom_from_body, &odom_from_submap));
            let pixels = ColorImage::new(camera as u8, header.width, header.height, bytes);
            images.push(pixels.ok_or("image: number of bytes does not match width and height")?);
        }
        let sweeps = &header.sweeps[..header.n_sweeps as usize];
        let mut buffers = PointBuffers::default();
        let points = SubmapPoints::new(submap.rows(), sweeps, header.stamp_begin, header.ring_counts(), &mut buffers);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let mut rows = vec![ColorRow::default(); submap.rows().len()];
        for (is_leveled, seconds) in [false, true].into_iter().zip(&mut sums.seconds) {
            let times = (0..5).map(|_| {
                let start = Instant::now();
                one.install(|| {
                    let visibility = &visibility_maps(&points, &exposures);
                    let candidates = Candidates { points: &points, exposures: &exposures, visibility, limits: LIMITS };
                    color_into(&candidates, &images, steps(is_leveled), &mut rows);
                });
                start.elapsed().as_secs_f64()
            });
            *seconds += times.fold(f64::INFINITY, f64::min);
        }
        let visibility = &visibility_maps(&points, &exposures);
        let candidates = Candidates { points: &points, exposures: &exposures, visibility, limits: LIMITS };
        compare(sums, &candidates, &images, submap.rows());
    }
    Ok(())
}

fn steps(level_exposures: bool) -> ColorSteps {
    ColorSteps { level_exposures, ..ColorSteps::default() }
}

/// The bytes of exposure `i` with another gain, by up to `stops`, with the approximate curve of sRGB.
fn brighter(bytes: &[u8], stops: f64, i: usize) -> Vec<u8> {
    // Multiples of the golden ratio are uniform.
    let share = 2.0 * (i as f64 * 0.618_034).fract() - 1.0;
    let factor = (share * stops).exp2().powf(1.0 / 2.2);
    bytes.iter().map(|level| (f64::from(*level) * factor).round() as u8).collect()
}

fn compare(sums: &mut Sums, candidates: &Candidates<'_>, images: &[ColorImage<'_>], points: &[SubmapPoint]) {
    let gains = ExposureGains::estimate(candidates, images);
    let sampler = Sampler::new(candidates, images, steps(true));
    // Exposure, and color as recorded and leveled.
    let mut colors: Vec<Option<(usize, [ColorRow; 2])>> = vec![None; points.len()];
    let mut choices = Choices::default();
    let mut chunks: Vec<Chunk> = Vec::new();
    for (index, colors) in colors.chunks_mut(CHUNK).enumerate() {
        chunks.push(Chunk::default());
        let chunk = &mut chunks[index];
        candidates.points.read_chunk(index, chunk);
        choices.choose(chunk, candidates);
        for choice in choices.chosen() {
            let PointChoice { i, exposure, pixel } = choice;
            let plain = images[exposure].sample(pixel);
            let Some(PointColor { row: level, .. }) = sampler.sample(chunk, choice) else { continue };
            let same = gains.leveled(plain, exposure);
            colors[i] = Some((exposure, [plain, level]));
            sums.n_points += 1;
            sums.n_other += usize::from(level != same);
        }
    }
    // The last point of each ring.
    let mut last = vec![None; 256];
    for (i, point) in points.iter().enumerate() {
        let before = last[usize::from(point.ring) % 256].replace(i);
        let Some(((before, (exposure, colors)), (exposure_before, colors_before))) =
            before.and_then(|before| Some(before).zip(colors[i]).zip(colors[before]))
        else {
            continue;
        };
        let near = &points[before];
        let apart = [point.x - near.x, point.y - near.y, point.z - near.z].iter().map(|v| v * v).sum::<f32>().sqrt();
        if apart < 0.1 && point.flags == 0 && near.flags == 0 {
            let sees =
                |exposure: usize, i: usize| candidates.visible_pixel(exposure, &chunks[i / CHUNK], i % CHUNK).is_some();
            let sums = if exposure == exposure_before {
                &mut sums.within
            } else if sees(exposure, before) && sees(exposure_before, i) {
                &mut sums.border
            } else {
                &mut sums.hidden
            };
            for k in 0..2 {
                sums[k].push(difference(colors[k], colors_before[k]));
            }
        }
    }
    for overlap in overlaps(candidates, 64, 32) {
        let [a, b] = [0, 1].map(|k| {
            let exposure = overlap.exposures[k];
            let pixel = overlap.pixels[k];
            let plain = images[exposure].sample(pixel);
            [plain, gains.leveled(plain, exposure)]
        });
        for (differences, (a, b)) in sums.twice.iter_mut().zip(a.into_iter().zip(b)) {
            differences.push(difference(a, b));
        }
    }
}

fn difference(a: ColorRow, b: ColorRow) -> f64 {
    color_difference::difference([a.r, a.g, a.b], [b.r, b.g, b.b])
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
