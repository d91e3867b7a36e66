//! Multiscale spherical neighborhoods (Thomas et al., 3DV 2018).

use crate::batch::Neighborhoods;
use crate::index::{Neighbor, SpatialIndex};
use crate::voxel_grid::{InvalidCell, VoxelGrid};

/// Radii of the spheres, and the density that limits their points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Radius of the smallest sphere, m.
    pub smallest_m: f32,
    /// Ratio of the radius of a sphere to the radius of the next smaller one.
    pub factor: f32,
    /// Number of spheres.
    pub n: usize,
    /// Ratio of the radius to the voxel side (`rho` of the paper): a sphere has at most [`Scales::most_points`].
    pub density: f32,
}

/// A scale has no usable radius or voxel.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("sphere {scale} of radius {radius_m} m: {cell}; check the smallest radius, the factor and the density")]
pub struct InvalidScales {
    /// Number of the scale, the smallest is 0.
    pub scale: usize,
    /// Radius of the scale, m.
    pub radius_m: f32,
    /// Voxels of the scale.
    pub cell: InvalidCell,
}

impl Scales {
    /// Radius of a scale, m.
    pub fn radius_m(&self, scale: usize) -> f32 {
        (0..scale).fold(self.smallest_m, |radius_m, _| radius_m * self.factor)
    }
    /// Side of the voxels of a scale, m: one point of each voxel is kept.
    pub fn cell_m(&self, scale: usize) -> f32 {
        self.radius_m(scale) / self.density
    }
    /// Largest number of points of a sphere: voxels that intersect a sphere of `density` voxels lie within
    /// `density + sqrt(3)` voxels of its center.
    pub fn most_points(&self) -> usize {
        let reach = f64::from(self.density) + 1.74;
        (4.0 / 3.0 * std::f64::consts::PI * reach * reach * reach) as usize
    }
}

/// A cloud at several scales: large spheres use a coarse cloud, so each sphere has a limited number of points.
#[derive(Clone, Debug)]
pub struct MultiscaleSpheres {
    scales: Scales,
    levels: Vec<Level>,
}

/// The cloud at one scale.
#[derive(Clone, Debug)]
struct Level {
    /// The first point of each voxel, ascending.
    kept: Vec<u32>,
    index: SpatialIndex,
}

impl MultiscaleSpheres {
    /// Subsamples and indexes the cloud at each scale.
    pub fn new(points: &[[f32; 3]], scales: Scales) -> Result<Self, InvalidScales> {
        let level = |scale| {
            let radius_m = scales.radius_m(scale);
            // An invalid factor can give valid voxels only in the middle of the scales, so each scale is checked.
            let grid =
                VoxelGrid::new(points, scales.cell_m(scale)).map_err(|cell| InvalidScales { scale, radius_m, cell })?;
            let kept = grid.first_points();
            let positions: Vec<[f32; 3]> = kept.iter().map(|point_idx| points[*point_idx as usize]).collect();
            Ok(Level { kept, index: SpatialIndex::new(&positions) })
        };
        Ok(Self { scales, levels: (0..scales.n).map(level).collect::<Result<_, _>>()? })
    }
    /// The scales.
    pub fn scales(&self) -> &Scales {
        &self.scales
    }
    /// Numbers of the points that are kept at a scale, ascending.
    pub fn kept(&self, scale: usize) -> &[u32] {
        &self.levels[scale].kept
    }
    /// The points of the cloud in the sphere of a scale around the query, nearest first.
    pub fn sphere(&self, query: [f32; 3], scale: usize) -> Vec<Neighbor> {
        let level = &self.levels[scale];
        let mut neighbors = level.index.within(query, self.scales.radius_m(scale));
        for neighbor in &mut neighbors {
            neighbor.index = level.kept[neighbor.index as usize];
        }
        neighbors
    }
    /// Numbers of the points in the sphere of a scale around each query, in Morton order.
    pub fn sphere_of_each(&self, queries: &[[f32; 3]], scale: usize) -> Neighborhoods<u32> {
        let level = &self.levels[scale];
        let mut neighborhoods = level.index.within_of_each(queries, self.scales.radius_m(scale));
        neighborhoods.for_each_item(|point_idx| *point_idx = level.kept[*point_idx as usize]);
        neighborhoods
    }
}
