//! Streets as scanned by a LiDAR: rays against boxes over flat ground.

use super::Street;
use messages::{ClassId, POINT_DYNAMIC, SubmapHeader, SubmapPoint, SubmapSweep};

/// Height of the LiDAR above the ground, m.
const HEIGHT_M: f32 = 1.8;

/// Time between two sweeps, ns.
pub const SWEEP_NANOS: i64 = 100_000_000;

/// A LiDAR: rings at equal spacing between two elevations, degrees, and columns.
#[derive(Clone, Copy)]
pub struct Lidar {
    pub n_rings: u16,
    pub n_columns: u16,
    pub elevations_deg: [f32; 2],
}

pub const HDL64: Lidar = Lidar { n_rings: 64, n_columns: 2000, elevations_deg: [-24.8, 2.0] };
pub const HDL32: Lidar = Lidar { n_rings: 32, n_columns: 1800, elevations_deg: [-30.7, 10.7] };

/// A box: smallest and largest x y z, its class and the number of its object; 0 = no object.
#[derive(Clone, Copy)]
pub struct Block {
    pub min: [f32; 3],
    pub max: [f32; 3],
    pub class: ClassId,
    pub thing: u32,
    pub is_marked: bool,
}

/// A car with this rear left corner: a body with a cabin, 4.2 m x 1.8 m x 1.5 m.
pub fn car([x, y]: [f32; 2], thing: u32) -> [Block; 2] {
    let block = |x0: f32, x1: f32, z0: f32, z1: f32| Block {
        min: [x + x0, y, z0],
        max: [x + x1, y + 1.8, z1],
        class: ClassId::Vehicles,
        thing,
        is_marked: false,
    };
    [block(0.0, 4.2, 0.2, 0.9), block(0.8, 3.2, 0.9, 1.5)]
}

/// A submap under construction.
pub struct Scan {
    pub header: Box<SubmapHeader>,
    pub street: Street,
}

impl Scan {
    /// An empty submap at the origin of odom.
    pub fn new(lidar: Lidar) -> Self {
        let mut header = Box::new(super::at([0.0; 3]));
        header.n_rings = u32::from(lidar.n_rings);
        Self { header, street: Street::default() }
    }

    /// Adds a sweep from this place at this time.
    pub fn sweep(&mut self, lidar: Lidar, [x, y]: [f32; 2], stamp: i64, blocks: &[Block]) {
        let place = [x, y, HEIGHT_M];
        let first_point = self.street.points.len();
        let sweep_idx = self.header.n_sweeps as u16;
        for column in 0..lidar.n_columns {
            let azimuth = std::f32::consts::TAU * f32::from(column) / f32::from(lidar.n_columns);
            for ring in 0..lidar.n_rings {
                let [low, high] = lidar.elevations_deg;
                let elevation_deg = low + (high - low) * f32::from(ring) / f32::from(lidar.n_rings - 1);
                let (sin, cos) = elevation_deg.to_radians().sin_cos();
                let ray = [cos * azimuth.cos(), cos * azimuth.sin(), sin];
                let Some((range_m, block)) = nearest(place, ray, blocks) else { continue };
                let position = std::array::from_fn(|axis| place[axis] + range_m * ray[axis]);
                let (class, thing) = block.map_or((ClassId::Road, 0), |block| (block.class, block.thing));
                self.street.push(position, class, thing);
                let point = self.street.points.last_mut().expect("was pushed");
                *point = SubmapPoint {
                    offset_nanos: (SWEEP_NANOS as f32 * f32::from(column) / f32::from(lidar.n_columns)) as u32,
                    elevation: (elevation_deg * 100.0) as i16,
                    ring: ring as u8,
                    sweep_idx,
                    flags: if block.is_some_and(|block| block.is_marked) { POINT_DYNAMIC } else { 0 },
                    ..*point
                };
            }
        }
        let pose = [place[0], place[1], place[2], 0.0, 0.0, 0.0, 1.0];
        self.header.sweeps[usize::from(sweep_idx)] = SubmapSweep {
            stamp,
            duration_nanos: SWEEP_NANOS as u32,
            first_point: first_point as u32,
            n_points: (self.street.points.len() - first_point) as u32,
            submap_from_lidar_begin: pose,
            submap_from_lidar_end: pose,
            ..SubmapSweep::default()
        };
        self.header.n_sweeps += 1;
    }
}

/// Range and block of the first return within 60 m; without a block, the return is from the ground.
fn nearest(place: [f32; 3], ray: [f32; 3], blocks: &[Block]) -> Option<(f32, Option<&Block>)> {
    let ground = (ray[2] < 0.0).then(|| (-place[2] / ray[2], None));
    let hits = blocks.iter().filter_map(|block| Some((hit(place, ray, block)?, Some(block))));
    hits.chain(ground).filter(|(range_m, _)| *range_m < 60.0).min_by(|a, b| a.0.total_cmp(&b.0))
}

fn hit(place: [f32; 3], ray: [f32; 3], block: &Block) -> Option<f32> {
    let mut enter = 0.0_f32;
    let mut leave = f32::INFINITY;
    for axis in 0..3 {
        let ends = [block.min[axis], block.max[axis]].map(|side| (side - place[axis]) / ray[axis]);
        enter = enter.max(ends[0].min(ends[1]));
        leave = leave.min(ends[0].max(ends[1]));
    }
    (enter > 0.0 && enter <= leave).then_some(enter)
}
