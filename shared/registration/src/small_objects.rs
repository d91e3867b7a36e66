//! Things that stand on the ground and are no larger than a lorry: all that may move (Deschaud 2018, III-A).

use crate::ground::GroundField;
use crate::{RangeImage, Sweep};

/// Largest box of a small object, m: along, across, up (Deschaud 2018).
const MAX_SIZE_M: [f32; 3] = [14.0, 14.0, 4.0];
/// Points of one object have neighbors nearer than this, m (Deschaud 2018)...
const LINK_M: f32 = 0.5;
/// ... or, far away, than this share of the range: 1.3 times the distance of an HDL-32E's rings.
const LINK_SHARE: f32 = 0.03;
/// Columns over which points are linked: single lost returns do not cut a thing in two.
const LINK_COLUMNS: usize = 3;
/// Fewer points tell nothing.
const MIN_POINTS: u32 = 5;

/// Which points of a sweep belong to which small object.
pub(crate) struct SmallObjects {
    /// Object of each point, [`SmallObjects::NONE`] for none.
    pub of_point: Vec<u32>,
    /// Objects.
    pub n: usize,
}

#[derive(Clone, Copy)]
struct Extent {
    low: [f32; 3],
    high: [f32; 3],
    n: u32,
}

impl SmallObjects {
    /// No object.
    pub const NONE: u32 = u32::MAX;

    /// `placed` are the sweep's points, deskewed, z up, seen from the lidar, m.
    pub fn found(sweep: &Sweep, placed: &[[f32; 3]]) -> Self {
        let ground = GroundField::grown(placed);
        let stands: Vec<bool> = placed.iter().map(|point| !ground.holds(*point)).collect();
        let mut sets = Sets { parents: (0..placed.len() as u32).collect() };
        link(sweep.image(), placed, &stands, &mut sets);
        // A set's first point is its root, so sets are numbered when they are met.
        let mut sets_of = vec![Self::NONE; placed.len()];
        let mut extents: Vec<Extent> = Vec::new();
        for (idx, point) in placed.iter().enumerate().filter(|(idx, _)| stands[*idx]) {
            let root = sets.root(idx as u32) as usize;
            if root == idx {
                sets_of[idx] = extents.len() as u32;
                extents.push(Extent { low: *point, high: *point, n: 0 });
            }
            sets_of[idx] = sets_of[root];
            extents[sets_of[idx] as usize].add(point);
        }
        let mut n = 0_u32;
        let numbers: Vec<u32> = extents
            .iter()
            .map(|extent| {
                let is_small = extent.is_small();
                n += u32::from(is_small);
                if is_small { n - 1 } else { Self::NONE }
            })
            .collect();
        let number = |set: &u32| if *set == Self::NONE { Self::NONE } else { numbers[*set as usize] };
        Self { of_point: sets_of.iter().map(number).collect(), n: n as usize }
    }

    /// Points of objects, at most so many of each, spread over it.
    pub fn members(&self, at_most: u32) -> Vec<u32> {
        let mut counts = vec![0_u32; self.n];
        let objects = |(idx, &object): (usize, &u32)| (object != Self::NONE).then_some((idx as u32, object as usize));
        for (_, object) in self.of_point.iter().enumerate().filter_map(objects) {
            counts[object] += 1;
        }
        let mut met = vec![0_u32; self.n];
        let is_chosen = |(idx, object): (u32, usize)| {
            let number = met[object];
            met[object] += 1;
            number.is_multiple_of(counts[object].div_ceil(at_most)).then_some(idx)
        };
        self.of_point.iter().enumerate().filter_map(objects).filter_map(is_chosen).collect()
    }
}

impl Extent {
    fn add(&mut self, point: &[f32; 3]) {
        self.low = std::array::from_fn(|axis| self.low[axis].min(point[axis]));
        self.high = std::array::from_fn(|axis| self.high[axis].max(point[axis]));
        self.n += 1;
    }
    fn is_small(&self) -> bool {
        let fits = |axis: usize| self.high[axis] - self.low[axis] < MAX_SIZE_M[axis];
        self.n >= MIN_POINTS && fits(0) && fits(1) && fits(2)
    }
}

/// Joins points that lie beside each other in the image and near each other in space.
fn link(image: &RangeImage, placed: &[[f32; 3]], stands: &[bool], sets: &mut Sets) {
    let standing = |row: usize, col: usize| image.point(row, col).filter(|&idx| stands[idx]);
    for row in 0..image.rows() {
        for col in 0..image.cols() {
            let Some(idx) = standing(row, col) else { continue };
            let [x, y, z] = placed[idx];
            let limit = LINK_M.max(LINK_SHARE * (x * x + y * y + z * z).sqrt());
            let right = (1..=LINK_COLUMNS).map(|step| (row, col + step));
            let above = [image.cols() - 1, 0, 1].map(|step| (row + 1, col + step));
            for (row, col) in right.chain(above.into_iter().filter(|(row, _)| *row < image.rows())) {
                let Some(other) = standing(row, col) else { continue };
                let [u, v, w] = placed[other];
                if (x - u).powi(2) + (y - v).powi(2) + (z - w).powi(2) < limit * limit {
                    sets.join(idx as u32, other as u32);
                }
            }
        }
    }
}

/// Disjoint sets of points; the root is the set's first point.
struct Sets {
    parents: Vec<u32>,
}

impl Sets {
    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        let (first, second) = (a.min(b), a.max(b));
        self.parents[second as usize] = first;
    }
    /// The root; the way to it is halved.
    fn root(&mut self, mut idx: u32) -> u32 {
        while self.parents[idx as usize] != idx {
            let grandparent = self.parents[self.parents[idx as usize] as usize];
            self.parents[idx as usize] = grandparent;
            idx = grandparent;
        }
        idx
    }
}
