use crate::clouds::{awkward, queries, real_sweep, sorted_by_distance, uniform};
use neighbors::{MultiscaleSpheres, Scales, SpatialIndex, VoxelGrid, squared_distance};

fn check(points: &[[f32; 3]], n_queries: usize, seed: u64) {
    let index = SpatialIndex::new(points);
    let queries = queries(points, n_queries, seed);
    let mut place = vec![usize::MAX; points.len()];
    for (i, point) in index.order().iter().enumerate() {
        place[*point as usize] = i;
    }
    for radius_m in [0.0, 1e-3, 0.5, 3.0, 25.0, 1e15, f32::INFINITY] {
        let batch = index.within_of_each(&queries, radius_m);
        let mapped = index.map_within_of_each(&queries, radius_m, |query, found| (query, found.to_vec()));
        assert_eq!(mapped.len(), queries.len());
        for (query_idx, query) in queries.iter().enumerate() {
            let mut expected = sorted_by_distance(points, *query);
            expected.retain(|(squared, _)| *squared <= radius_m * radius_m);
            let found = index.within(*query, radius_m);
            let pairs: Vec<(f32, u32)> = found.iter().map(|n| (n.squared_m2, n.index)).collect();
            assert_eq!(pairs, expected, "{radius_m} m around {query:?}, seed {seed}");
            let mut numbers: Vec<u32> = expected.iter().map(|(_, point)| *point).collect();
            numbers.sort_unstable_by_key(|point| place[*point as usize]);
            assert_eq!(batch.get(query_idx), numbers, "batch, {radius_m} m around {query:?}, seed {seed}");
            assert_eq!(mapped[query_idx], (query_idx, numbers), "mapped, {radius_m} m around {query:?}, seed {seed}");
        }
    }
}

#[test]
fn within_of_random_clouds_equal_a_search_over_all_points() {
    for seed in 0..40 {
        let n = [1, 2, 15, 16, 17, 100, 1000, 3000][seed as usize % 8];
        check(&uniform(n, seed), 20, seed);
        check(&awkward(n, seed), 20, seed);
    }
}

#[real_data::test("kitti00/000094.bin")]
fn within_of_a_real_sweep_equal_a_search_over_all_points() {
    check(&real_sweep(), 20, 1);
}

#[test]
fn within_of_own_equal_those_of_the_same_queries() {
    let points = awkward(3000, 5);
    let index = SpatialIndex::new(&points);
    let own = index.within_of_own(0.5);
    let each = index.within_of_each(&points, 0.5);
    let mapped = index.map_within_of_own(0.5, |point_idx, found| (point_idx, found.to_vec()));
    assert_eq!(own.n_items(), each.n_items());
    assert_eq!(mapped.len(), points.len());
    for (point_idx, mapped) in mapped.into_iter().enumerate() {
        assert_eq!(own.get(point_idx), each.get(point_idx), "{point_idx}");
        assert_eq!(mapped, (point_idx, own.get(point_idx).to_vec()));
    }
}

#[test]
fn spheres_equal_a_search_over_the_voxel_grid_of_their_scale_and_keep_the_cap() {
    let scales = Scales { smallest_m: 0.4, factor: 2.0, n: 4, density: 5.0 };
    for points in [uniform(20_000, 1), awkward(5000, 2)] {
        let spheres = MultiscaleSpheres::new(&points, scales).expect("valid scales");
        for scale in 0..4 {
            let kept = VoxelGrid::new(&points, scales.cell_m(scale)).expect("a valid cell").first_points();
            assert_eq!(spheres.kept(scale), kept);
            let queries = queries(&points, 30, scale as u64);
            let batch = spheres.sphere_of_each(&queries, scale);
            for (query_idx, query) in queries.iter().enumerate() {
                let radius_m = scales.radius_m(scale);
                let to_query = |point: &u32| squared_distance(points[*point as usize], *query);
                let mut expected = kept.clone();
                expected.retain(|point| to_query(point) <= radius_m * radius_m);
                assert!(expected.len() <= scales.most_points(), "{} points", expected.len());
                let mut of_batch = batch.get(query_idx).to_vec();
                of_batch.sort_unstable();
                assert_eq!(of_batch, expected);
                expected.sort_by(|a, b| to_query(a).total_cmp(&to_query(b)).then(a.cmp(b)));
                let found: Vec<u32> = spheres.sphere(*query, scale).iter().map(|n| n.index).collect();
                assert_eq!(found, expected);
            }
        }
    }
}
