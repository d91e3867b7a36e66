//! The offset between points and images of a run, with planted errors:
//! `cargo run --release -p colorize --example offset_of_run -- DRIVE RECORDING [turn X Y Z] [delay MS]`.
//!
//! RECORDING has the topics submap, trajectory and image. `turn` turns every camera of the rig about its own axes, degrees, before
//! anything is projected; `delay` moves the stamps of all images back, ms. What is found should be the opposite turn, and that delay.

#[path = "common/recorded.rs"]
mod recorded;

use colorize::cloud::{Cloud, Memory};
use colorize::color::Picture;
use colorize::occlusion::sights;
use colorize::offset::Look;
use colorize::offset_watch::{Watch, look, sentence};
use colorize::views::Camera;
use formats::drive::Drive;
use geometry::{RigCamera, Stamp, UnitQuaternion, Vector3};
use recorded::Recorded;
use std::error::Error;
use std::path::Path;

/// Times beside an exposure at which its delay is tried, ns.
const BESIDE_NANOS: i64 = 20_000_000;

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
    let cameras: Vec<Camera> = (drive.rig().cameras.iter())
        .map(|camera| {
            let told = UnitQuaternion::from_scaled_axis(turn);
            Camera::from(&RigCamera { body_from_camera: camera.body_from_camera * told, model: camera.model.clone() })
        })
        .collect();
    let Recorded { submaps, images, trajectory, .. } = Recorded::open(Path::new(recording), false)?;
    let mut watch = Watch::default();
    for submap in &submaps {
        let header = submap.header();
        let world_from_submap = header.world_from_submap.to_pose().ok_or("no pose")?;
        let (mut views, mut beside, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        for image in &images {
            let stamp = image.stamp() - delay_nanos;
            if !(header.stamp_begin..header.stamp_end).contains(&stamp) {
                continue;
            }
            let index = image.header().camera as usize;
            let view = |stamp: i64| Some(cameras[index].view(stamp, &trajectory.at(Stamp(stamp))?, &world_from_submap));
            let Some(((view, before), after)) =
                view(stamp).zip(view(stamp - BESIDE_NANOS)).zip(view(stamp + BESIDE_NANOS))
            else {
                continue;
            };
            let Some(picture) = Picture::new(index as u8, image.header().width, image.header().height, image.rows())
            else {
                continue;
            };
            views.push(view);
            beside.push([before, after]);
            pictures.push((index, picture));
        }
        let mut memory = Memory::default();
        let sweeps = &header.sweeps[..header.n_sweeps as usize];
        let cloud = Cloud::new(submap.rows(), sweeps, header.stamp_begin, header.n_rings, &mut memory);
        let sights = sights(&cloud, &views);
        let looks: Vec<(usize, Look<'_>)> = (0..views.len())
            .map(|i| {
                let beside_s = 2e-9 * BESIDE_NANOS as f32;
                (
                    pictures[i].0,
                    Look { view: views[i], beside: beside[i], beside_s, sight: &sights[i], picture: pictures[i].1 },
                )
            })
            .collect();
        watch.keep(look(&cloud, &looks));
    }
    let start = std::time::Instant::now();
    let offset = watch.offset();
    println!(
        "delay {:?} s, {}; fitted in {:.2} s",
        offset.delay_s,
        if offset.tells_delay { "observable" } else { "not observable" },
        start.elapsed().as_secs_f64()
    );
    for (i, found) in offset.cameras.iter().enumerate() {
        println!(
            "{}",
            sentence(&drive.manifest().cameras[i].name, cameras[i].px_per_rad(), found, &watch.by_range(i, &offset))
        );
    }
    Ok(())
}
