//! Compression of the law's covariance to the four-row factor that the controller evaluates.

use kou_estimator::model::calibrated_region::{Bound, RegionConfig};
use kou_estimator::model::leakage_law::LawCovarianceFactor;
use kou_estimator::units::LeakageCoefficient;
use nalgebra::DMatrix;

use crate::convert::single;
use crate::joint::Observation;
use crate::law_fit::phi;

/// Number of rows of the factor.
const ERROR_ROWS: usize = 4;
/// Steps per axis of the grid over the region on which the factor is computed.
const REGION_STEPS: usize = 8;

/// Low-rank factor of the law's covariance `A A^T`, by principal components of the law's error over the region.
///
/// With `F` the regressors at the points and on a grid over the region, the right singular vectors `v` of `F A` are independent
/// errors, ordered by their effect on the law (Jolliffe 2002). The first four give `R`, by a QR decomposition of `(A v)^T`; the
/// maximum joint effect of the others is the remainder.
pub(crate) fn error_factor(
    factor: &DMatrix<f64>,
    terms: &[usize],
    rows: &[Observation],
    region: &RegionConfig,
) -> LawCovarianceFactor {
    let mut all = DMatrix::zeros(10, factor.ncols());
    for (row, term) in terms.iter().enumerate() {
        all.row_mut(*term).copy_from(&factor.row(row));
    }
    // The grid does not contain the corners of the region; the points do.
    let at_rows = rows.iter().map(|row| {
        let mut all = [0.0; 10];
        for (term, value) in terms.iter().zip(&row.phi) {
            all[*term] = *value;
        }
        all
    });
    let regressors: Vec<f64> = grid_over(region).into_iter().map(phi).chain(at_rows).flatten().collect();
    let at_points = DMatrix::from_row_slice(regressors.len() / 10, 10, &regressors) * &all;
    let eigen = nalgebra::SymmetricEigen::new(at_points.transpose() * &at_points);
    let (values, vectors) = (eigen.eigenvalues, eigen.eigenvectors);
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let (main, minor) = order.split_at(ERROR_ROWS.min(order.len()));
    let remainder2 = at_points
        .row_iter()
        .map(|row| minor.iter().map(|i| (row * vectors.column(*i))[0].powi(2)).sum::<f64>())
        .fold(0.0, f64::max);
    // Padded with zeros to ten rows: the decomposition needs at least as many rows as columns.
    let mut transposed = DMatrix::zeros(10, 10);
    for (k, i) in main.iter().enumerate() {
        transposed.row_mut(k).copy_from(&(&all * vectors.column(*i)).transpose());
    }
    let r = transposed.qr().r();
    fn row<const N: usize>(r: &DMatrix<f64>) -> [f32; N] {
        let first = 10 - N;
        std::array::from_fn(|j| single(r[(first, first + j)]).clamp(-100.0, 100.0))
    }
    LawCovarianceFactor {
        first: row(&r),
        second: row(&r),
        third: row(&r),
        fourth: row(&r),
        remainder: LeakageCoefficient(single(remainder2.sqrt()).min(10.0)),
    }
}

/// Normalised grid points inside a region; those of its bounding box if the region is too thin for the grid.
fn grid_over(region: &RegionConfig) -> Vec<[f64; 3]> {
    let along = |bound: Bound| {
        let (min, max) = (f64::from(bound.min), f64::from(bound.max));
        (0..=REGION_STEPS).map(move |i| min + (max - min) * i as f64 / REGION_STEPS as f64)
    };
    let (inside, outside): (Vec<_>, Vec<_>) = along(region.speed)
        .flat_map(|x| along(region.pressure).map(move |y| (x, y)))
        .flat_map(|(x, y)| along(region.temperature).map(move |z| [x, y, z]))
        .partition(|point| region.outside(point.map(single)).is_none());
    if inside.is_empty() { outside } else { inside }
}
