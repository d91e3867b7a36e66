use crate::clouds::{awkward, real_sweep, uniform};
use neighbors::{LIMIT_M, SpatialIndex, VoxelGrid, random_sample, squared_distance};
use std::collections::{BTreeMap, BTreeSet};

/// Algorithm 1 of the thesis from a given first point; of equally far points the first.
fn farthest_over_all_points(points: &[[f32; 3]], n: usize, first: u32) -> Vec<u32> {
    let is_valid = |p: &[f32; 3]| p.iter().all(|v| v.abs() <= LIMIT_M);
    let mut rest: BTreeMap<u32, f32> =
        points.iter().enumerate().filter(|(_, p)| is_valid(p)).map(|(i, _)| (i as u32, f32::INFINITY)).collect();
    let mut sample = vec![first];
    rest.remove(&first);
    while sample.len() < n && !rest.is_empty() {
        let newest = points[*sample.last().expect("has the first") as usize];
        for (point, squared) in &mut rest {
            *squared = squared.min(squared_distance(points[*point as usize], newest));
        }
        let mut best = (-1.0, 0);
        for (point, squared) in &rest {
            if *squared > best.0 {
                best = (*squared, *point);
            }
        }
        rest.remove(&best.1);
        sample.push(best.1);
    }
    sample
}

#[test]
fn farthest_points_equal_those_of_a_search_over_all_points() {
    for seed in 0..30 {
        let n = [1, 2, 16, 17, 200, 1500][seed as usize % 6];
        for points in [uniform(n, seed), awkward(n, seed)] {
            let sample = SpatialIndex::new(&points).farthest_points(300, seed);
            assert_eq!(sample, farthest_over_all_points(&points, 300, sample[0]), "seed {seed}, {n} points");
        }
    }
}

#[real_data::test("kitti00/000094.bin")]
fn farthest_points_of_a_real_sweep_equal_those_of_a_search_over_all_points() {
    let points = real_sweep();
    let sample = SpatialIndex::new(&points).farthest_points(50, 1);
    assert_eq!(sample, farthest_over_all_points(&points, 50, sample[0]));
}

#[test]
fn voxel_grid_groups_points_by_cell_and_keeps_first_points_and_barycenters() {
    for points in [uniform(3000, 4), awkward(3000, 4)] {
        let grid = VoxelGrid::new(&points, 0.7).expect("a valid cell");
        let mut voxels: BTreeMap<[i128; 3], Vec<u32>> = BTreeMap::new();
        for (i, p) in points.iter().enumerate().filter(|(_, p)| p.iter().all(|v| v.abs() <= LIMIT_M)) {
            let cell = p.map(|v| (f64::from(v) / f64::from(0.7_f32)).floor() as i128);
            voxels.entry(cell).or_default().push(i as u32);
        }
        let mut expected: Vec<Vec<u32>> = voxels.into_values().collect();
        expected.sort_by_key(|members| members[0]);
        let found: Vec<Vec<u32>> = (0..grid.len()).map(|voxel| grid.points_of(voxel).to_vec()).collect();
        assert_eq!(found, expected);
        assert_eq!(grid.first_points(), expected.iter().map(|members| members[0]).collect::<Vec<_>>());
        for (members, barycenter) in expected.iter().zip(grid.barycenters(&points)) {
            for (axis, found) in barycenter.iter().enumerate() {
                let mean =
                    members.iter().map(|i| f64::from(points[*i as usize][axis])).sum::<f64>() / members.len() as f64;
                assert_eq!(*found, mean as f32);
            }
        }
    }
}

#[test]
fn random_sample_has_different_points_and_repeats_by_seed() {
    let sample = random_sample(1000, 100, 7);
    assert_eq!(sample.len(), 100);
    assert_eq!(sample.iter().collect::<BTreeSet<_>>().len(), 100);
    assert!(sample.iter().all(|point| *point < 1000));
    assert_eq!(sample, random_sample(1000, 100, 7));
    assert_eq!(sample[..50], random_sample(1000, 50, 7));
    assert_ne!(sample, random_sample(1000, 100, 8));
    assert_eq!(random_sample(3, 100, 1).into_iter().collect::<BTreeSet<_>>(), BTreeSet::from([0, 1, 2]));
    assert_eq!(random_sample(0, 100, 1), []);
}

#[test]
fn random_sample_draws_each_point_equally_often() {
    let mut drawn = [0; 10];
    for seed in 0..10_000 {
        for point in random_sample(10, 3, seed) {
            drawn[point as usize] += 1;
        }
    }
    // Expected 3000, standard deviation 46.
    assert!(drawn.iter().all(|n| (2770..3230).contains(n)), "{drawn:?}");
}
