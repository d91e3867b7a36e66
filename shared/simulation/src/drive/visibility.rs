//! `truth/visibility`: the cameras in which each return is visible.
//!
//! One file per sweep, `<sweep, 6 digits>.visibility`, little-endian:
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `REPLVIS1` |
//! | 4 | number of exposures e near in time |
//! | 4 | number of returns r, in the order of the sweep's `.label` file |
//! | 8 e | stamps of the exposures, i64 |
//! | r e b | by return, then by exposure, b bytes, one for each eight cameras or part of eight: bit k % 8 of byte k / 8 is set if the return is visible in camera k: color cameras by index, then mosaic cameras (6 is HS02 and 7 HS03 on the vehicle of the thesis) |
//!
//! A return is visible if a ray from the camera, at the middle of the exposure, hits the surface there. Objects that have
//! moved away are therefore not visible. Leaves stop each ray at random, and it may end within half a metre.

use super::files::Folder;
use crate::error::SimulationError;
use crate::simulation::Simulation;
use geometry::{CameraModel, Point3, Pose, Stamp, Vector3};
use lidar::SweepReader;
use messages::ClassId;
use random::hash;
use rayon::prelude::*;
use raytrace::Ray;
use town::{SceneHit, Snapshot};

/// Exposures within this time of a sweep are included, s: 20 m at 10 m/s.
const NEAR_SECONDS: f64 = 2.0;
/// Five standard deviations of the lidar's range, m.
const TOLERANCE_M: f64 = 0.1;
/// Tolerance across the surface for grazing incidence, m.
const TOLERANCE_ACROSS_M: f64 = 0.06;
/// Tolerance along the ray for grazing incidence and in leaves, m.
const TOLERANCE_LEAVES_M: f64 = 0.5;

struct CameraView {
    camera_from_world: Pose,
    model: CameraModel,
}

struct NearExposure {
    stamp: Stamp,
    snapshot: Snapshot,
    views: Vec<CameraView>,
}

/// Writes the files of all sweeps of the capture, which must exist.
pub fn write(simulation: &Simulation, folder: &Folder, stamps: &[Stamp]) -> Result<(), SimulationError> {
    let capture = folder.path("lidar/000000.pcap")?;
    let failed =
        |error: &dyn std::fmt::Display| SimulationError::write(&capture)(std::io::Error::other(error.to_string()));
    let mut reader = SweepReader::open(vec![capture.clone()], Some(&simulation.rig.lidar.model.into()))
        .map_err(|error| failed(&error))?;
    let exposures: Vec<NearExposure> = stamps.iter().map(|stamp| near_exposure(simulation, *stamp)).collect();
    loop {
        let mut returns = Vec::new();
        let sweep = reader.next_sweep(|some| returns.extend_from_slice(some)).map_err(|error| failed(&error))?;
        let Some(sweep) = sweep else { return Ok(()) };
        let near: Vec<&NearExposure> =
            exposures.iter().filter(|e| e.stamp.seconds_since(sweep.stamp).abs() <= NEAR_SECONDS).collect();
        let masks: Vec<u8> = returns
            .par_iter()
            .flat_map_iter(|found| {
                let seconds = sweep.stamp.seconds_since(simulation.motion.begin) + f64::from(found.offset_nanos) * 1e-9;
                let p = Point3::new(f64::from(found.x), f64::from(found.y), f64::from(found.z));
                let p_in_world = simulation.motion.pose(seconds) * simulation.rig.lidar.body_from_lidar * p;
                near.iter().flat_map(move |exposure| masks(simulation, exposure, p_in_world))
            })
            .collect();
        let mut bytes = b"REPLVIS1".to_vec();
        bytes.extend((near.len() as u32).to_le_bytes());
        bytes.extend((returns.len() as u32).to_le_bytes());
        bytes.extend(near.iter().flat_map(|exposure| exposure.stamp.0.to_le_bytes()));
        bytes.extend(masks);
        folder.write(&format!("truth/visibility/{:06}.visibility", sweep.seq), &bytes)?;
    }
}

fn near_exposure(simulation: &Simulation, stamp: Stamp) -> NearExposure {
    let seconds = stamp.seconds_since(simulation.motion.begin);
    let world_from_body = simulation.motion.pose(seconds);
    let rig = &simulation.rig;
    let color = rig.cameras.iter().map(|camera| (camera.body_from_camera, camera.lens.clone()));
    let mosaics = rig.mosaics.iter().map(|camera| (camera.body_from_camera, camera.lens.clone()));
    let view = |(pose, model): (Pose, CameraModel)| CameraView {
        camera_from_world: (world_from_body * pose).inverse(),
        model,
    };
    NearExposure { stamp, snapshot: simulation.scene.at(seconds), views: color.chain(mosaics).map(view).collect() }
}

/// A bit for each camera.
fn masks<'a>(simulation: &'a Simulation, exposure: &'a NearExposure, p: Point3<f64>) -> impl Iterator<Item = u8> + 'a {
    let bit = move |view: &CameraView| {
        let in_picture = view.model.pixel_from_camera(&(view.camera_from_world * p)).is_some_and(|pixel| {
            let (width, height) = view.model.size();
            let inside = |at: f64, side: u32| at >= -0.5 && at < f64::from(side) - 0.5;
            inside(pixel.x, width) && inside(pixel.y, height)
        });
        u8::from(in_picture && is_seen(simulation, exposure, view, &p))
    };
    exposure.views.chunks(8).map(move |eight| eight.iter().rev().fold(0, |mask, view| mask << 1 | bit(view)))
}

fn is_seen(simulation: &Simulation, exposure: &NearExposure, view: &CameraView, p: &Point3<f64>) -> bool {
    let eye = view.camera_from_world.inverse() * Point3::origin();
    let toward: Vector3<f64> = p - eye;
    let distance = toward.norm();
    let direction = (toward / distance).cast::<f32>();
    let seed = hash(exposure.stamp.0 as u64, p.x.to_bits());
    let ray = Ray { origin: eye.coords.cast(), direction, seed };
    let hit = simulation.scene.cast(&exposure.snapshot, &ray, (distance + TOLERANCE_LEAVES_M) as f32);
    hit.is_some_and(|hit: SceneHit| {
        let gap = (distance - f64::from(hit.range_m)).abs();
        let across = gap * f64::from(hit.normal.dot(&direction).abs());
        let leaves = hit.surface.class == ClassId::Vegetation;
        gap < TOLERANCE_M || (gap < TOLERANCE_LEAVES_M && (leaves || across < TOLERANCE_ACROSS_M))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DriveSpec;

    #[test]
    fn leaves_stop_each_ray_by_its_own_chance() {
        let simulation = Simulation::new(&DriveSpec::urban(1, 6.0)).expect("a town");
        let exposure = near_exposure(&simulation, *simulation.exposures().last().expect("exposures"));
        let mut n_leaves = 0;
        let mut n_mixed = 0;
        for view in &exposure.views[..6] {
            let world_from_camera = view.camera_from_world.inverse();
            let (width, height) = view.model.size();
            for (u, v) in (0..width).step_by(16).flat_map(|u| (0..height).step_by(16).map(move |v| (u, v))) {
                let Some(ray) = view.model.ray_from_pixel(&[f64::from(u), f64::from(v)].into()) else { continue };
                let direction = world_from_camera * ray.normalize();
                let origin = world_from_camera.translation.vector;
                let ray = Ray { origin: origin.cast(), direction: direction.cast(), seed: 1 };
                let Some(hit) = simulation.scene.cast(&exposure.snapshot, &ray, 30.0) else { continue };
                if hit.surface.class != ClassId::Vegetation {
                    continue;
                }
                let p = Point3::from(origin + direction * f64::from(hit.range_m));
                // Positions of the return that differ by at most a hundredth of a millimetre.
                let shifted = (0..40).map(|k| p + Vector3::x() * f64::from(k) * 2.5e-7);
                let n_seen = shifted.filter(|p| is_seen(&simulation, &exposure, view, p)).count();
                n_leaves += 1;
                n_mixed += usize::from((1..40).contains(&n_seen));
            }
        }
        // With one random number for all rays to a crown, such returns would be all visible or all hidden.
        assert!(n_leaves > 100 && 2 * n_mixed > n_leaves, "{n_mixed} of {n_leaves}");
    }
}
