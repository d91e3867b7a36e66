//! Evaluates a model on simulated towns.

use super::labelled_submap::range_m;
use super::source::{Origin, Source};
use super::tally::{Tally, TrueClass};
use super::{Args, error_picture};
use anyhow::Context;
use command_line::say_error;
use messages::{ClassId, ClassRow};
use segmentation::{ModelInput, Segmenter};
use std::path::Path;
use std::time::{Duration, Instant};
use town_sweeps::{Mount, TownDrive, TownSubmap, town_from_name};

/// True classes that are not scored: thesis section 6.2 leaves out unlabeled, other, dynamic and sky.
pub const NOT_SCORED: [ClassId; 4] = [ClassId::Unlabeled, ClassId::Other, ClassId::Dynamic, ClassId::Sky];

/// Scores the model on each drive, with each sensor.
pub fn sources(model: &dyn Segmenter, args: &Args, empty: &Tally) -> anyhow::Result<Vec<Source>> {
    let mut sources = Vec::new();
    let mut picture = args.picture.as_deref();
    for name in &args.towns {
        let town = town_from_name(name)?;
        for &seed in &args.seeds {
            let drive = TownDrive { town, seed, seconds: args.seconds };
            let simulation = drive.simulation()?;
            for sensor in &args.sensor {
                let mount = Mount::from_name(sensor).with_context(|| format!("unknown sensor {sensor}"))?;
                let mut tally = empty.clone();
                let mut time = Duration::ZERO;
                for mut submap in drive.submaps_in(&simulation, args.submaps, args.sweeps, 1, mount)? {
                    scale_intensities(&mut submap, args.gain);
                    time += add(&mut tally, model, &submap, picture.take())?;
                }
                // Names without sensor if there is only one.
                let of_sensor = if args.sensor.len() > 1 { format!("{sensor}-") } else { String::new() };
                let name = format!("{of_sensor}{name}-{seed}");
                let n_sweeps = args.submaps * args.sweeps;
                let ms = 1e3 * time.as_secs_f64() / n_sweeps.max(1) as f64;
                say_error!("{name}: {ms:.1} ms per sweep");
                let origin = Origin::Simulated(sensor.clone());
                sources.push(Source { name, origin, n_sweeps, has_intensities: true, tally, other_uses: Vec::new() });
            }
        }
    }
    Ok(sources)
}

/// Scales intensities, as another sensor would report them.
fn scale_intensities(submap: &mut TownSubmap, gain: f32) {
    for point in &mut submap.points {
        point.intensity = (f32::from(point.intensity) * gain).round() as u8;
    }
}

/// Adds the points of a submap. Returns the time of the model.
fn add(
    tally: &mut Tally,
    model: &dyn Segmenter,
    submap: &TownSubmap,
    picture: Option<&Path>,
) -> anyhow::Result<Duration> {
    let TownSubmap { header, points, truth } = submap;
    let mut classes = vec![ClassRow::default(); points.len()];
    let begin = Instant::now();
    model.segment(&ModelInput::new(header, points), &mut classes)?;
    let time = begin.elapsed();
    if let Some(path) = picture {
        let predicted: Vec<u8> = classes.iter().map(|row| row.class_id).collect();
        error_picture::write(path, points, truth, &predicted)?;
    }
    for ((point, row), &class) in points.iter().zip(classes).zip(truth) {
        if !NOT_SCORED.iter().any(|not| *not as u8 == class) {
            tally.add(TrueClass::from_id(class), row, range_m(header, point));
        }
    }
    Ok(time)
}
