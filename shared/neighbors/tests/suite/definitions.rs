//! Inputs at the limits, as defined by the table of the crate.

use crate::clouds::awkward;
use neighbors::{LIMIT_M, MultiscaleSpheres, Scales, SpatialIndex, VoxelGrid, around};

#[test]
fn empty_cloud_has_no_neighbors_and_no_samples() {
    for points in [vec![], vec![[f32::NAN; 3]; 3]] {
        let index = SpatialIndex::new(&points);
        assert!(index.is_empty());
        assert_eq!(index.n_cloud(), points.len());
        assert_eq!(index.nearest([0.0; 3], 5), []);
        assert_eq!(index.within([0.0; 3], f32::INFINITY), []);
        assert_eq!(index.nearest_of_each(&[[0.0; 3]], 5).get(0), []);
        assert_eq!(index.within_of_own(1.0).n_items(), 0);
        assert_eq!(index.farthest_points(5, 1), []);
        assert!(VoxelGrid::new(&points, 1.0).expect("a valid cell").is_empty());
    }
}

#[test]
fn points_and_queries_that_are_not_finite_have_no_neighbors() {
    let points = awkward(100, 1);
    let index = SpatialIndex::new(&points);
    // NaN, infinite, beyond the limit.
    assert_eq!(index.len(), points.len() - 3);
    let own = index.nearest_of_own(500);
    for point_idx in points.len() - 3..points.len() {
        assert_eq!(own.get(point_idx), []);
    }
    assert!((0..points.len() - 3).all(|point_idx| own.get(point_idx).len() == index.len()));
    for query in [[f32::NAN, 0.0, 0.0], [0.0, f32::NEG_INFINITY, 0.0], [0.0, 0.0, 1.1 * LIMIT_M]] {
        assert_eq!(index.nearest(query, 3), []);
        assert_eq!(index.within(query, f32::INFINITY), []);
    }
}

#[test]
fn k_of_zero_and_invalid_radii_find_nothing() {
    let index = SpatialIndex::new(&[[0.0; 3]; 3]);
    assert_eq!(index.nearest([0.0; 3], 0), []);
    assert_eq!(index.nearest_of_own(0).get(1), []);
    for radius_m in [-1.0, f32::NAN, f32::NEG_INFINITY] {
        assert_eq!(index.within([0.0; 3], radius_m), []);
        assert_eq!(index.within_of_own(radius_m).get(1), []);
    }
}

#[test]
fn copies_of_a_point_are_found_in_the_order_of_their_numbers() {
    let index = SpatialIndex::new(&[[1.0, 2.0, 3.0]; 1000]);
    let numbers = |found: Vec<neighbors::Neighbor>| found.into_iter().map(|n| n.index).collect::<Vec<_>>();
    assert_eq!(numbers(index.nearest([1.0, 2.0, 3.0], 40)), (0..40).collect::<Vec<_>>());
    assert_eq!(numbers(index.nearest([0.0; 3], 400)), (0..400).collect::<Vec<_>>());
    assert_eq!(numbers(index.within([1.0, 2.0, 3.0], 0.0)), (0..1000).collect::<Vec<_>>());
    assert_eq!(index.farthest_points(1000, 1).len(), 1000);
}

#[test]
fn utm_coordinates_relative_to_an_origin_keep_their_millimetres() {
    let origin = [452_000.0, 5_411_000.0, 100.0];
    let utm: Vec<[f64; 3]> =
        (0..1000).map(|i| [452_000.0 + f64::from(i), 5_411_000.25 + f64::from(i) * 0.001, 100.0]).collect();
    let points: Vec<[f32; 3]> = around(origin, utm.iter().copied()).collect();
    for (p, utm) in points.iter().zip(&utm) {
        for axis in 0..3 {
            assert!((f64::from(p[axis]) + origin[axis] - utm[axis]).abs() <= 0.031e-3);
        }
    }
    let index = SpatialIndex::new(&points);
    let query = around(origin, [[452_700.4, 5_411_000.95, 100.0]]).next().expect("one query");
    assert_eq!(index.nearest(query, 1)[0].index, 700);
}

#[test]
fn invalid_voxels_and_scales_are_reported() {
    for cell_m in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let error = VoxelGrid::new(&[[0.0; 3]], cell_m).expect_err("is invalid").to_string();
        assert!(error.contains("must be a positive, finite number"), "{error}");
    }
    let scales = Scales { smallest_m: 1.0, factor: 2.0, n: 3, density: 5.0 };
    for invalid in [Scales { factor: f32::INFINITY, ..scales }, Scales { density: 0.0, ..scales }] {
        let error = MultiscaleSpheres::new(&[[0.0; 3]], invalid).expect_err("is invalid").to_string();
        assert!(error.contains("check the smallest radius, the factor and the density"), "{error}");
    }
}
