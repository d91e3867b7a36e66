//! k-means: the start of mixtures without maxima (approach 1 of section 3.5.1).

use crate::mixture::nearest;
use crate::space::Points;
use random::Random;

/// Number of passes after the first means; k-means is only a start here.
const PASSES: usize = 20;

/// Up to `k` means of points, fewer if there are fewer distinct points: k-means++ (Arthur and Vassilvitskii 2007), then
/// Lloyd's iterations.
pub(crate) fn k_means(points: &Points, k: usize, seed: u64) -> Vec<[f64; 3]> {
    let mut random = Random::new(seed);
    let mut means = vec![points.at(random.index(points.len()))];
    let square = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|k| (a[k] - b[k]).powi(2)).iter().sum::<f64>();
    let mut squares = vec![f64::INFINITY; points.len()];
    while means.len() < k {
        let newest = means[means.len() - 1];
        let mut sum = 0.0;
        for (index, nearest) in squares.iter_mut().enumerate() {
            *nearest = nearest.min(square(points.at(index), newest));
            sum += *nearest;
        }
        if sum <= 0.0 {
            break;
        }
        // Two numbers of 24 bits: one could not select every point of a large image.
        let mut left = (f64::from(random.unit()) + f64::from(random.unit()) / f64::from(1 << 24)) * sum;
        let chosen = squares.iter().position(|square| {
            left -= square;
            left < 0.0
        });
        means.push(points.at(chosen.unwrap_or(points.len() - 1)));
    }
    for _ in 0..PASSES {
        let mut sums = vec![([0.0; 3], 0.0); means.len()];
        for (index, of) in nearest(points, &means).into_iter().enumerate() {
            let (sum, n) = &mut sums[of as usize];
            let point = points.at(index);
            (0..3).for_each(|k| sum[k] += point[k]);
            *n += 1.0;
        }
        for (mean, (sum, n)) in means.iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0.0) {
            *mean = sum.map(|value| value / n);
        }
    }
    means
}
