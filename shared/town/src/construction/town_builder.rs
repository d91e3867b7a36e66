//! A town under construction: its street map, the objects built so far, and queries about positions.

use crate::construction::block_use::BlockUse;
use crate::construction::reach::{DETAIL_RADIUS_M, Reach};
use crate::kind::{Town, Traffic};
use crate::scene_builder::SceneBuilder;
use crate::streets::country::Stretch;
use crate::streets::network::{Leg, Network};
use crate::streets::paving::Pavings;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};

/// A town under construction. The other modules add objects in their own `impl` blocks.
pub struct TownBuilder {
    pub kind: Town,
    pub traffic: Traffic,
    pub builder: SceneBuilder,
    pub network: Network,
    pub reach: Reach,
    pub pavings: Pavings,
    /// Land use along the streets of a rural town's round.
    pub stretches: [Stretch; 7],
    /// Uses of the blocks, by block number.
    pub uses: Vec<BlockUse>,
    pub instances: Instances,
}

/// Assigns instance numbers to vehicles and people.
#[derive(Debug, Default)]
pub struct Instances(u16);

impl Instances {
    /// The next number; 0 means no instance.
    pub fn next(&mut self) -> u16 {
        // The longest round holds a few thousand.
        self.0 = self.0.checked_add(1).unwrap_or_else(|| unreachable!("more than 65535 instances"));
        self.0
    }
}

impl TownBuilder {
    /// Whether the ego vehicle drives on a street.
    pub fn is_on_round(&self, street: usize) -> bool {
        self.network.round.iter().any(|leg| leg.street == street)
    }
    /// Whether the ego vehicle passes a node.
    pub fn is_node_on_round(&self, node: usize) -> bool {
        self.network.round.iter().any(|leg| self.network.streets[leg.street].nodes.contains(&node))
    }
    /// The block on a side (1 left, -1 right) of a street.
    pub fn block_beside(&self, street: usize, side: f64) -> Option<usize> {
        let wanted = Leg { street, is_forward: side > 0.0 };
        self.network.blocks.iter().position(|legs| legs.contains(&wanted))
    }
    /// Streets to build: the streets of the round and their neighbors within the detail radius.
    pub fn built_streets(&self) -> Vec<usize> {
        let is_near = |number: &usize| {
            let street = &self.network.streets[*number];
            let n = (street.length_m / 10.0) as usize;
            (0..=n).any(|i| self.reach.is_near(&street.plan(i as f64 * 10.0, 0.0), DETAIL_RADIUS_M))
        };
        let is_visible = |number: &usize| self.network.streets[*number].nodes.iter().any(|n| self.is_node_on_round(*n));
        (0..self.network.streets.len()).filter(is_visible).filter(is_near).collect()
    }
    /// Whether a position in street coordinates is within the detail radius.
    pub fn is_built(&self, street: usize, s: f64, t: f64) -> bool {
        self.reach.is_near(&self.network.streets[street].plan(s, t), DETAIL_RADIUS_M)
    }
    /// The frame of an upright object on the uneven ground of a street, rotated by `yaw` (rad).
    pub fn stand(&self, street: usize, s: f64, t: f64, yaw: f64) -> Isometry3<f32> {
        let street = &self.network.streets[street];
        let h = street.profile.height(t) + self.network.terrain.uneven(&street.plan(s, t));
        street.upright(s, t, h, yaw)
    }
    /// The frame of an upright object `h` above the terrain.
    pub fn stand_at(&self, p: &Vector2<f64>, h: f64, yaw: f64) -> Isometry3<f32> {
        let at = Vector3::new(p.x, p.y, self.network.terrain.height(p) + h);
        Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)).cast()
    }
}
