//! Comparison of a result with a given path.

use crate::{Placed, PointPair, align_odometry};
use geometry::{Geodetic, LocalFrame, Point3, Pose, Stamp, Trajectory, Vector3, heading};
use messages::{FRAME_EAST_NORTH_UP, PlacementHeader};

/// Least number of submaps that are compared.
const MIN_SUBMAPS: usize = 3;

/// A submap by the result and by the path.
struct Compared {
    result: Pose,
    given: Pose,
}

/// One line for the operator: root mean square differences between the submaps of a result and a path, in the world if both are
/// on the Earth, otherwise after alignment. `local`: the world of the path.
pub fn path_difference(placed: &Placed, path: &Trajectory, local: Option<&LocalFrame>) -> String {
    let compared: Vec<Compared> = placed
        .rows
        .iter()
        .filter_map(|row| {
            Some(Compared { result: row.world_from_submap.to_pose()?, given: path.at(Stamp(row.stamp))? })
        })
        .collect();
    if compared.len() < MIN_SUBMAPS {
        return "the given path has too few poses at the times of the submaps and is not compared".into();
    }
    let world = local.zip(world_of(&placed.header));
    let in_world: Vec<Pose> = if let Some((local, world)) = &world {
        compared.iter().map(|pair| moved(&pair.given, local, world)).collect()
    } else {
        let pair = |pair: &Compared| PointPair {
            p_in_odom: Point3::from(pair.given.translation.vector),
            p_in_world: Point3::from(pair.result.translation.vector),
            weight: 1.0,
        };
        let pairs: Vec<PointPair> = compared.iter().map(pair).collect();
        let Some(alignment) = align_odometry(&pairs, None) else {
            return "the given path and the result cannot be aligned and are not compared".into();
        };
        compared.iter().map(|pair| alignment.world_from_odom * pair.given).collect()
    };
    let mut squares = [0.0; 3];
    for (Compared { result, .. }, given) in compared.iter().zip(&in_world) {
        let off = result.translation.vector - given.translation.vector;
        let turn = heading(&given.rotation).inverse() * heading(&result.rotation);
        squares[0] += off.xy().norm_squared();
        squares[1] += off.z * off.z;
        squares[2] += turn.angle().to_degrees().powi(2);
    }
    let n = compared.len();
    let [across_m, up_m, heading_deg] = squares.map(|sum| (sum / n as f64).sqrt());
    let after = if world.is_some() { "" } else { ", after alignment" };
    format!(
        "the given path differs from the result by {across_m:.2} m horizontally, {up_m:.2} m in height and {heading_deg:.2} deg in heading \
         (RMS of {n} submaps{after})"
    )
}

fn world_of(header: &PlacementHeader) -> Option<LocalFrame> {
    let PlacementHeader { latitude_deg, longitude_deg, altitude_m, frame, .. } = *header;
    let is_on_earth = frame == FRAME_EAST_NORTH_UP;
    Geodetic::new(latitude_deg, longitude_deg, altitude_m).filter(|_| is_on_earth).map(LocalFrame::new)
}

/// A pose of one world in another one.
fn moved(pose: &Pose, from: &LocalFrame, to: &LocalFrame) -> Pose {
    let place = from.geodetic_from_world(&Point3::from(pose.translation.vector));
    let position: Vector3<f64> = to.world_from_geodetic(&place).coords;
    Pose::from_parts(position.into(), to.rotation_from(from) * pose.rotation)
}
