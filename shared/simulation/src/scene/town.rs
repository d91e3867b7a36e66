//! A town that is being filled, and the order in which it is.

use super::builder::Builder;
use super::country::{self, Stretch};
use super::grid::{self, GridStyle};
use super::lane::{self, Lane};
use super::network::{Leg, Network};
use super::open_blocks::BlockUse;
use super::paving::Pavings;
use super::profile::LANE_T;
use super::reach::Reach;
use super::{Scene, ground, junction};
use crate::pace::{Driver, Pace};
use crate::random::Random;
use crate::spec::Town as Kind;
use crate::trace::Bvh;
use crate::way::Way;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use std::sync::Arc;

/// How far from the driven way the town is built, m: as far as a lidar sees.
pub const BUILT_M: f64 = 105.0;
/// From the mouth of its first street to where the vehicle stands at second 0, m.
const START_M: f64 = 8.0;
/// Every so many crossings with lights one is red.
const RED_EVERY: usize = 4;
/// From the front of the recording vehicle's place to a stop line, m.
const STOP_BEFORE_M: f64 = 3.5;

/// A town with the recording vehicle's drive through it.
#[derive(Debug)]
pub struct Drive {
    /// What there is.
    pub scene: Scene,
    /// The vehicle's way.
    pub way: Arc<Way>,
    /// When it is where on it.
    pub pace: Arc<Pace>,
}

/// The town of a seed and a drive of `seconds` through it, built as far as its sensors reach.
pub fn build(kind: Kind, seed: u64, seconds: f64) -> Drive {
    let mut random = Random::new(seed, 0x00c1_7100);
    let stretches = country::stretches(match kind {
        Kind::Field => Some(Stretch::Field),
        Kind::Tunnel => Some(Stretch::Tunnel),
        _ => None,
    });
    let mut network = match kind {
        Kind::Urban => grid::build(seed, &GridStyle::URBAN),
        Kind::Suburban => grid::build(seed, &GridStyle::SUBURBAN),
        Kind::Rural | Kind::Field | Kind::Tunnel => country::build(seed, &stretches),
    };
    start_at_stretch(&mut network, kind, &stretches);
    let Some(Lane { way, legs }) = lane::around(&network, &network.round, -LANE_T) else {
        unreachable!("every map has a round");
    };
    let way = Arc::new(way);
    let driver = Driver {
        cruise_mps: if matches!(kind, Kind::Urban | Kind::Suburban) { 9.0 } else { 11.5 },
        phase: f64::from(random.range(0.0, std::f32::consts::TAU)),
        stops: stops(&network, &legs, way.length_m(), &mut random),
    };
    let pace = Arc::new(Pace::from_rest(&way, &driver, legs[0][0] + START_M, seconds));
    // Two seconds more: the last revolution is completed.
    let reach = Reach::new(&way, pace.length_m(0.0), pace.length_m(seconds + 0.2));
    let mut builder = Builder::default();
    let pavings = Pavings::new(&mut builder);
    let uses = BlockUse::of_blocks(&network, kind, &mut random);
    let mut town = Town { kind, builder, network, reach, pavings, stretches, uses, instances: Instances::default() };
    town.pave();
    town.fill(&mut random);
    let movers = town.traffic(&way, &legs, &driver, &pace, seconds, &mut random);
    let Town { builder, .. } = town;
    let scene = Scene { statics: Bvh::new(builder.primitives), movers, surfaces: builder.surfaces };
    Drive { scene, way, pace }
}

/// Drives through fields and tunnels begin there; rural ones at the end of the village.
fn start_at_stretch(network: &mut Network, kind: Kind, stretches: &[Stretch]) {
    let wanted = match kind {
        Kind::Urban | Kind::Suburban => return,
        Kind::Rural => Stretch::Village,
        Kind::Field => Stretch::Field,
        Kind::Tunnel => Stretch::Tunnel,
    };
    let is_last_wanted = |k: usize| {
        let n = network.round.len();
        let at = |k: usize| stretches[network.round[k % n].street] == wanted;
        if wanted == Stretch::Village { at(k) && !at(k + 1) } else { at(k) && !at(k + n - 1) }
    };
    let first = (0..network.round.len()).find(|k| is_last_wanted(*k)).unwrap_or(0);
    network.round.rotate_left(first);
}

/// Red lights: every few crossings, not before the third, for as many rounds as the longest drive makes.
fn stops(network: &Network, legs: &[[f64; 2]], round_m: f64, random: &mut Random) -> Vec<(f64, f64)> {
    const MAX_ROUNDS: usize = 6;
    let mut stops = Vec::new();
    for round in 0..MAX_ROUNDS {
        for (k, leg) in network.round.iter().enumerate() {
            if network.nodes[network.node_after(*leg)].has_lights && k % RED_EVERY == 2 {
                let wait = f64::from(random.range(9.0, 15.0));
                stops.push((round as f64 * round_m + legs[k][1] - ground::STOP_LINE[1] - STOP_BEFORE_M, wait));
            }
        }
    }
    stops
}

/// A town that is being filled. What fills it is in the modules of its `impl`s.
pub struct Town {
    pub kind: Kind,
    pub builder: Builder,
    pub network: Network,
    pub reach: Reach,
    pub pavings: Pavings,
    /// What lies along the streets of a rural town's round.
    pub stretches: [Stretch; 7],
    /// What the blocks are used for, by their number.
    pub uses: Vec<BlockUse>,
    pub instances: Instances,
}

/// Gives every vehicle and person a number.
#[derive(Debug, Default)]
pub struct Instances(u16);

impl Instances {
    /// The next one; 0 means none.
    pub fn next(&mut self) -> u16 {
        // The longest round holds a few thousand.
        self.0 = self.0.checked_add(1).unwrap_or_else(|| unreachable!("more than 65535 instances"));
        self.0
    }
}

impl Town {
    /// Whether the recording vehicle drives on a street.
    pub fn is_on_round(&self, street: usize) -> bool {
        self.network.round.iter().any(|leg| leg.street == street)
    }
    /// Whether a node is passed by the recording vehicle.
    pub fn is_node_on_round(&self, node: usize) -> bool {
        self.network.round.iter().any(|leg| self.network.streets[leg.street].nodes.contains(&node))
    }
    /// The block on a side (1 left, -1 right) of a street.
    pub fn block_beside(&self, street: usize, side: f64) -> Option<usize> {
        let wanted = Leg { street, is_forward: side > 0.0 };
        self.network.blocks.iter().position(|legs| legs.contains(&wanted))
    }
    /// Streets that are built: those of the round and their neighbors, as far as they are near.
    pub fn built_streets(&self) -> Vec<usize> {
        let is_near = |number: &usize| {
            let street = &self.network.streets[*number];
            let n = (street.length_m / 10.0) as usize;
            (0..=n).any(|i| self.reach.is_near(&street.plan(i as f64 * 10.0, 0.0), BUILT_M))
        };
        let is_visible = |number: &usize| self.network.streets[*number].nodes.iter().any(|n| self.is_node_on_round(*n));
        (0..self.network.streets.len()).filter(is_visible).filter(is_near).collect()
    }
    /// Whether something at a place beside a street is near enough to be built.
    pub fn is_built(&self, street: usize, s: f64, t: f64) -> bool {
        self.reach.is_near(&self.network.streets[street].plan(s, t), BUILT_M)
    }
    /// The frame of something upright on a street's uneven ground, turned by `yaw` (rad).
    pub fn stand(&self, street: usize, s: f64, t: f64, yaw: f64) -> Isometry3<f32> {
        let street = &self.network.streets[street];
        let h = street.profile.height(t) + self.network.terrain.uneven(&street.plan(s, t));
        street.upright(s, t, h, yaw)
    }
    /// The frame of something upright `h` above the terrain.
    pub fn stand_at(&self, p: &Vector2<f64>, h: f64, yaw: f64) -> Isometry3<f32> {
        let at = Vector3::new(p.x, p.y, self.network.terrain.height(p) + h);
        Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)).cast()
    }

    fn pave(&mut self) {
        for street in self.built_streets() {
            ground::street(self, street);
        }
        for node in 0..self.network.nodes.len() {
            if self.is_node_on_round(node) && self.reach.is_near(&self.network.nodes[node].at, BUILT_M) {
                junction::pave(self, node);
            }
        }
        ground::bed(self);
    }

    fn fill(&mut self, random: &mut Random) {
        for street in self.built_streets() {
            match self.kind {
                Kind::Urban => self.urban_street(street, random),
                Kind::Suburban => self.suburban_street(street, random),
                Kind::Rural | Kind::Field | Kind::Tunnel => self.rural_street(street, random),
            }
            self.park_cars(street, random);
            self.waiting_cars(street, random);
        }
        self.open_blocks(random);
    }

    fn urban_street(&mut self, street: usize, random: &mut Random) {
        for side in [-1.0, 1.0] {
            self.row_of_houses(street, side, random);
            self.kerbside(street, side, random);
        }
        self.lights(street, random);
        self.closures(street, random);
    }

    fn suburban_street(&mut self, street: usize, random: &mut Random) {
        for side in [-1.0, 1.0] {
            self.gardens(street, side, random);
            self.quiet_kerbside(street, side, random);
        }
    }
}
