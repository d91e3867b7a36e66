//! Geometry and ground truth of submaps.

use geometry::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion};
use messages::{ClassId, GROUND_CLASSES, SubmapPoint};
use simulation::Town;
use town_sweeps::{Mount, TownDrive};

fn pose(row: &[f32; 7]) -> Isometry3<f32> {
    let [x, y, z, i, j, k, w] = *row;
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)))
}

#[test]
fn points_lie_on_the_ray_of_their_laser_and_azimuth() {
    for mount in [Mount::Rig, Mount::Random] {
        let drive = TownDrive { town: Town::Urban, seed: 9100, seconds: 2.0 };
        let submap = &drive.submaps(1, 2, 1, mount).expect("makes a town")[0];
        assert_eq!(submap.points.len(), submap.truth.len());
        assert_eq!(submap.header.n_sweeps, 2);
        for sweep in &submap.header.sweeps[..2] {
            let range = sweep.first_point as usize..(sweep.first_point + sweep.n_points) as usize;
            assert!(range.len() > 20_000, "{} returns", range.len());
            // A quarter of the revolution, where the lidar of the rig points at houses. In 2 ms the vehicle moves less than 2 cm.
            let [begin, end] = [&sweep.submap_from_lidar_begin, &sweep.submap_from_lidar_end].map(pose);
            let lidar_from_submap = begin.lerp_slerp(&end, 0.25).inverse();
            let is_sideward = |point: &&SubmapPoint| (24_000_000..26_000_000).contains(&point.offset_nanos);
            let mut n = 0;
            for point in submap.points[range].iter().filter(is_sideward) {
                let seen = lidar_from_submap * Point3::new(point.x, point.y, point.z);
                let range_m = seen.coords.norm();
                if range_m < 4.0 {
                    continue;
                }
                let elevation_deg = (seen.z / range_m).asin().to_degrees();
                assert!((elevation_deg - f32::from(point.elevation) * 0.01).abs() < 0.4, "{point:?}");
                let azimuth_deg = (-seen.y).atan2(seen.x).to_degrees();
                let off = (azimuth_deg - f32::from(point.azimuth) * 0.01 + 540.0).rem_euclid(360.0) - 180.0;
                assert!(off.abs() < 0.5, "{off} at {point:?}");
                n += 1;
            }
            assert!(n > 50, "{n} points checked");
        }
    }
}

#[test]
fn true_classes_have_plausible_heights_and_are_reproducible() {
    let drive = TownDrive { town: Town::Urban, seed: 9100, seconds: 2.0 };
    let make = || drive.submaps(1, 1, 1, Mount::Rig).expect("makes a town").remove(0);
    let submap = make();
    let mean_z = |is: &dyn Fn(u8) -> bool| {
        let of: Vec<f32> = submap.points.iter().zip(&submap.truth).filter(|(_, c)| is(**c)).map(|(p, _)| p.z).collect();
        of.iter().sum::<f32>() / of.len() as f32
    };
    // The body frame is 1 m above the road.
    let ground = mean_z(&|class| GROUND_CLASSES.iter().any(|of| *of as u8 == class));
    let building = mean_z(&|class| class == ClassId::Building as u8);
    assert!((ground + 1.0).abs() < 0.5 && building > ground + 1.5, "{ground} {building}");
    let again = make();
    assert!(again.points == submap.points && again.truth == submap.truth);
}
