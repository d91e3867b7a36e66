//! How much colors change where one exposure ends and the next begins, with and without leveling:
//! `cargo run --release -p colorize --example color_seams -- STOPS DRIVE RECORDING [DRIVE RECORDING …]`.
//!
//! STOPS is a planted fault: exposures are made brighter or darker by up to so many stops, another one for each, as of cameras that set
//! their exposures themselves.
//!
//! RECORDING has the topics submap, trajectory and image of a run on DRIVE. Neighbors on a ring, at most 0.1 m apart, are compared: those
//! of one exposure tell what the street itself does, those of two what the border adds: where both exposures see both points, the choice
//! draws it; elsewhere something that stands before one of them does. Points in the middle between those that the gains
//! are found from tell how differently two exposures show the same thing.

#[path = "color_truth/lab.rs"]
mod lab;
#[path = "common/recorded.rs"]
mod recorded;

use colorize::choose::{Choices, Limits, Sources, View};
use colorize::chunk::CHUNK;
use colorize::cloud::{Cloud, Memory};
use colorize::color::{Picture, color_into, leveled};
use colorize::level::{Levels, overlaps};
use colorize::occlusion::sights;
use colorize::views::Camera;
use formats::drive::Drive;
use geometry::Stamp;
use messages::{ColorRow, SubmapPoint};
use recorded::Recorded;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Defaults of the stage.
const LIMITS: Limits = Limits { max_age_s: 1.0, max_moving_age_s: 0.1 };
const MAX_AGE_NANOS: i64 = 1_000_000_000;

/// dE as they are and leveled.
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
    println!("| dE | pairs | as they are: mean, half below | leveled: mean, half below |");
    for (name, [plain, level]) in [
        ("within an exposure", &sums.within),
        ("across a border, both seen by both", &sums.border),
        ("across a border, one hidden from the other", &sums.hidden),
        ("one point, two exposures", &sums.twice),
    ] {
        let [a, b] = [plain, level].map(|values| (mean(values), half(values)));
        println!("| {name} | {} | {:.2}, {:.2} | {:.2}, {:.2} |", plain.len(), a.0, a.1, b.0, b.1);
    }
    let [plain, level] = sums.seconds;
    println!("{} colored points, {} from another exposure", sums.n_points, sums.n_other);
    println!("occlusion and color: {plain:.3} s as they are, {level:.3} s leveled (the least of 5, one thread)");
    Ok(())
}

fn add(sums: &mut Sums, stops: f64, drive: &Drive, recorded: &Recorded) -> Result<(), Box<dyn Error>> {
    let cameras: Vec<Camera> = drive.rig().cameras.iter().map(Camera::from).collect();
    let bytes: Vec<Vec<u8>> =
        recorded.images.iter().enumerate().map(|(i, image)| brighter(image.rows(), stops, i)).collect();
    for submap in &recorded.submaps {
        let header = submap.header();
        let world_from_submap = header.world_from_submap.to_pose().ok_or("no pose")?;
        let reach = header.stamp_begin - MAX_AGE_NANOS..=header.stamp_end + MAX_AGE_NANOS;
        let (mut views, mut pictures): (Vec<View<'_>>, Vec<Picture<'_>>) = (Vec::new(), Vec::new());
        for (image, bytes) in recorded.images.iter().zip(&bytes).filter(|(image, _)| reach.contains(&image.stamp())) {
            let (header, camera) = (image.header(), image.header().camera as usize);
            let Some(world_from_body) = recorded.trajectory.at(Stamp(image.stamp())) else { continue };
            views.push(cameras[camera].view(image.stamp(), &world_from_body, &world_from_submap));
            let picture = Picture::new(camera as u8, header.width, header.height, bytes);
            pictures.push(picture.ok_or("an image does not have its size")?);
        }
        let sweeps = &header.sweeps[..header.n_sweeps as usize];
        let mut memory = Memory::default();
        let cloud = Cloud::new(submap.rows(), sweeps, header.stamp_begin, header.n_rings, &mut memory);
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        let mut rows = vec![ColorRow::default(); submap.rows().len()];
        for (is_leveled, seconds) in [false, true].into_iter().zip(&mut sums.seconds) {
            let times = (0..5).map(|_| {
                let start = Instant::now();
                one.install(|| {
                    let sources =
                        Sources { cloud: &cloud, views: &views, sights: &sights(&cloud, &views), limits: LIMITS };
                    color_into(&sources, &pictures, is_leveled, &mut rows);
                });
                start.elapsed().as_secs_f64()
            });
            *seconds += times.fold(f64::INFINITY, f64::min);
        }
        let sights = sights(&cloud, &views);
        let sources = Sources { cloud: &cloud, views: &views, sights: &sights, limits: LIMITS };
        look(sums, &sources, &pictures, submap.rows());
    }
    Ok(())
}

/// As if exposure `i` had another gain, by up to `stops`; by the curve of sRGB, nearly.
fn brighter(bytes: &[u8], stops: f64, i: usize) -> Vec<u8> {
    // Multiples of the golden section are spread evenly.
    let share = 2.0 * (i as f64 * 0.618_034).fract() - 1.0;
    let factor = (share * stops).exp2().powf(1.0 / 2.2);
    bytes.iter().map(|level| (f64::from(*level) * factor).round() as u8).collect()
}

fn look(sums: &mut Sums, sources: &Sources<'_>, pictures: &[Picture<'_>], points: &[SubmapPoint]) {
    let levels = Levels::find(sources, pictures);
    // View, and color as it is and leveled.
    let mut colors: Vec<Option<(usize, [ColorRow; 2])>> = vec![None; points.len()];
    let mut choices = Choices::default();
    for (chunk, colors) in sources.cloud.chunks().iter().zip(colors.chunks_mut(CHUNK)) {
        choices.fill(chunk, sources);
        for (i, view, pixel) in choices.seen() {
            let plain = pictures[view].sample(pixel);
            let level = leveled(&levels, sources, pictures, chunk, (i, view, pixel));
            let same = levels.leveled(plain, view);
            colors[i] = Some((view, [plain, level]));
            sums.n_points += 1;
            sums.n_other += usize::from(level != same);
        }
    }
    // The last point of each ring.
    let mut last = vec![None; 256];
    for (i, point) in points.iter().enumerate() {
        let before = last[usize::from(point.ring) % 256].replace(i);
        let Some(((before, (view, colors)), (view_before, colors_before))) =
            before.and_then(|before| Some(before).zip(colors[i]).zip(colors[before]))
        else {
            continue;
        };
        let near = &points[before];
        let apart = [point.x - near.x, point.y - near.y, point.z - near.z].iter().map(|v| v * v).sum::<f32>().sqrt();
        if apart < 0.1 && point.flags == 0 && near.flags == 0 {
            let sees =
                |view: usize, i: usize| sources.seen(view, &sources.cloud.chunks()[i / CHUNK], i % CHUNK).is_some();
            let sums = if view == view_before {
                &mut sums.within
            } else if sees(view, before) && sees(view_before, i) {
                &mut sums.border
            } else {
                &mut sums.hidden
            };
            for k in 0..2 {
                sums[k].push(difference(colors[k], colors_before[k]));
            }
        }
    }
    for overlap in overlaps(sources, 64, 32) {
        let [a, b] = [0, 1].map(|k| {
            let (view, pixel) = (overlap.views[k], overlap.pixels[k]);
            let plain = pictures[view].sample(pixel);
            [plain, levels.leveled(plain, view)]
        });
        for (differences, (a, b)) in sums.twice.iter_mut().zip(a.into_iter().zip(b)) {
            differences.push(difference(a, b));
        }
    }
}

fn difference(a: ColorRow, b: ColorRow) -> f64 {
    lab::difference([a.r, a.g, a.b], [b.r, b.g, b.b])
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn half(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
