use crate::clouds::{awkward, queries, real_sweep, sorted_by_distance, uniform};
use neighbors::{Neighbor, SpatialIndex};

fn pairs(neighbors: &[Neighbor]) -> Vec<(f32, u32)> {
    neighbors.iter().map(|neighbor| (neighbor.squared_m2, neighbor.index)).collect()
}

fn check(points: &[[f32; 3]], n_queries: usize, seed: u64) {
    let index = SpatialIndex::new(points);
    let queries = queries(points, n_queries, seed);
    for k in [1, 2, 16, 64, 65, 300] {
        let batch = index.nearest_of_each(&queries, k);
        for (query_idx, query) in queries.iter().enumerate() {
            let all = sorted_by_distance(points, *query);
            let expected = &all[..k.min(all.len())];
            assert_eq!(pairs(&index.nearest(*query, k)), expected, "k {k}, query {query:?}, seed {seed}");
            assert_eq!(pairs(batch.get(query_idx)), expected, "batch, k {k}, query {query:?}, seed {seed}");
        }
    }
}

#[test]
fn nearest_of_random_clouds_equal_a_search_over_all_points() {
    for seed in 0..40 {
        let n = [1, 2, 15, 16, 17, 100, 1000, 3000][seed as usize % 8];
        check(&uniform(n, seed), 20, seed);
        check(&awkward(n, seed), 20, seed);
    }
}

#[real_data::test("kitti00/000094.bin")]
fn nearest_of_a_real_sweep_equal_a_search_over_all_points() {
    check(&real_sweep(), 20, 1);
}

#[test]
fn nearest_of_own_equal_those_of_the_same_queries() {
    for points in [uniform(5000, 3), awkward(5000, 3)] {
        let index = SpatialIndex::new(&points);
        let own = index.nearest_of_own(16);
        let each = index.nearest_of_each(&points, 16);
        assert_eq!(own.len(), points.len());
        for point_idx in 0..points.len() {
            assert_eq!(own.get(point_idx), each.get(point_idx), "{point_idx}");
        }
    }
}
