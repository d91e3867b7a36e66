//! Measures the offset between points and images of a run, with planted errors:
//! `cargo run --release -p studies --example offset_of_run -- DRIVE RECORDING [turn X Y Z] [delay MS]`.
//!
//! RECORDING contains the topics submap, trajectory and image. `turn` rotates every camera of the rig about its own axes, degrees;
//! `delay` makes the stamps of all images earlier, ms. The expected result is the opposite rotation, and that delay.

use camera_alignment::report::camera_line;
use camera_alignment::{AlignmentExposure, OffsetMonitor, profiles_of_exposures};
use coloring::{ColorImage, PointBuffers, ProjectionCamera, SubmapPoints, visibility_maps};
use drive::Drive;
use geometry::{RigCamera, Stamp, UnitQuaternion, Vector3};
use std::error::Error;
use std::path::Path;
use studies::recorded::Recorded;

/// Time before and after an exposure at which its pose is evaluated, ns.
const SHIFT_NANOS: i64 = 20_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [drive, recording, rest @ ..] = &words[..] else {
        return Err("usage: DRIVE RECORDING [turn X Y Z] [delay MS]".into());
    };
    let number = |word: &str, place: usize| -> f64 {
        let at = rest.iter().position(|found| found == word);
        at.and_then(|at| rest.get(at + place)?.parse().ok()).unwrap_or_default()
    };
    let turn = Vector3::new(number("turn", 1), number("turn", 2), number("turn", 3)).map(f64::to_radians);
    let delay_nanos = (number("delay", 1) * 1e6) as i64;

    let drive = Drive::open(Path::new(drive))?;
    let cameras: Vec<ProjectionCamera> = (drive.rig().cameras.iter())
        .map(|camera| {
            let planted = UnitQuaternion::from_scaled_axis(turn);
            let body_from_camera = camera.body_from_camera * planted;
            ProjectionCamera::from(&RigCamera { body_from_camera, model: camera.model.clone() })
        })
        .collect();
    let Recorded { submaps, images, trajectory, .. } = Recorded::open(Path::new(recording), false)?;
    let mut monitor = OffsetMonitor::default();
    for submap in &submaps {
        let header = submap.header();
        let odom_from_submap =
            header.odom_from_submap.to_pose().ok_or("submap: odom_from_submap is not a valid pose")?;
        let mut exposures = Vec::new();
        let mut shifted = Vec::new();
        let mut pixels = Vec::new();
        for image in &images {
            let stamp = image.stamp() - delay_nanos;
            if !(header.stamp_begin..header.stamp_end).contains(&stamp) {
                continue;
            }
            let index = image.header().camera as usize;
            let at =
                |stamp: i64| Some(cameras[index].exposure(stamp, &trajectory.at(Stamp(stamp))?, &odom_from_submap));
            let Some(((exposure, before), after)) = at(stamp).zip(at(stamp - SHIFT_NANOS)).zip(at(stamp + SHIFT_NANOS))
            else {
                continue;
            };
            let Some(image) = ColorImage::new(index as u8, image.header().width, image.header().height, image.rows())
            else {
                continue;
            };
            exposures.push(exposure);
            shifted.push([before, after]);
            pixels.push(image);
        }
        let mut buffers = PointBuffers::default();
        let sweeps = &header.sweeps[..header.n_sweeps as usize];
        let points = SubmapPoints::new(submap.rows(), sweeps, header.stamp_begin, header.ring_counts(), &mut buffers);
        let visibility = visibility_maps(&points, &exposures);
        let monitored: Vec<AlignmentExposure<'_>> = (0..exposures.len())
            .map(|i| {
                let shift_s = 2e-9 * SHIFT_NANOS as f32;
                let image = pixels[i];
                let exposure = exposures[i];
                let shifted = shifted[i];
                let visibility = &visibility[i];
                AlignmentExposure { exposure, shifted, shift_s, visibility, image }
            })
            .collect();
        monitor.add(profiles_of_exposures(&points, &monitored));
    }
    let start = std::time::Instant::now();
    let offset = monitor.offset();
    println!(
        "delay {:?} s, {}; fitted in {:.2} s",
        offset.delay_s,
        if offset.is_delay_observable { "observable" } else { "not observable" },
        start.elapsed().as_secs_f64()
    );
    for (i, found) in offset.cameras.iter().enumerate() {
        println!(
            "{}",
            camera_line(
                &drive.manifest().cameras[i].name,
                cameras[i].px_per_rad(),
                found,
                &monitor.by_range(i, &offset)
            )
        );
    }
    Ok(())
}
