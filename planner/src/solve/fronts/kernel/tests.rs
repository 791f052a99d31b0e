//! Kernels against dense algebra, for every number of pivots and border lines around the sizes of blocks and tiles.

use super::*;
use crate::test_robots::uniform;
use nalgebra::{DMatrix, DVector};

/// Panel and update matrix of one front, with the dense matrix that they come from.
struct Case {
    pivots: usize,
    border: usize,
    dense: DMatrix<f64>,
    panel: Vec<f64>,
    update: Vec<f64>,
}

impl Case {
    fn new(pivots: usize, border: usize) -> Self {
        let mut random = uniform((pivots * 1000 + border) as u64);
        let size = pivots + border;
        let factor = DMatrix::from_fn(size, size, |_, _| random());
        // The condition number is at most a few hundred.
        let dense = &factor * factor.transpose() + DMatrix::identity(size, size);
        let stride = padded(pivots) + padded(border);
        let mut panel = vec![0.0; pivots * stride];
        for column in 0..pivots {
            for line in column..size {
                panel[column * stride + line_of(line, pivots)] = dense[(line, column)];
            }
        }
        let width = padded(border);
        Self { pivots, border, dense, panel, update: vec![f64::NAN; width * width] }
    }

    fn stride(&self) -> usize {
        padded(self.pivots) + padded(self.border)
    }

    /// Factorises with the widest vectors of the processor, or without vectors.
    fn factorise(&mut self, scalar: bool) -> Option<()> {
        let (stride, pivots) = (self.stride(), self.pivots);
        let work = Factorise { panel: &mut self.panel, stride, pivots, update: &mut self.update };
        if scalar { work.with_simd(pulp::Scalar) } else { pulp::Arch::new().dispatch(work) }
    }
}

/// Line of the panel for a line of the dense matrix.
fn line_of(line: usize, pivots: usize) -> usize {
    if line < pivots { line } else { padded(pivots) + line - pivots }
}

fn cases() -> impl Iterator<Item = Case> {
    let sizes = [1, 2, 3, 4, 5, 7, 8, 9, 12, 16, 17, 24, 31];
    let borders = [0, 1, 3, 7, 8, 9, 23, 24, 25, 40];
    sizes.into_iter().flat_map(move |pivots| borders.map(|border| Case::new(pivots, border)))
}

#[test]
fn factor_and_update_matrix_are_those_of_dense_algebra() {
    for mut case in cases() {
        let (pivots, border, stride) = (case.pivots, case.border, case.stride());
        for scalar in [false, true] {
            case = Case::new(pivots, border);
            case.factorise(scalar).expect("positive definite");
            let square = case.dense.view((0, 0), (pivots, pivots)).into_owned();
            let below = case.dense.view((pivots, 0), (border, pivots));
            let factor = square.cholesky().expect("positive definite").unpack();
            // X·Lᵀ = B for the border.
            let of_border = factor.solve_lower_triangular(&below.transpose()).expect("regular");
            for column in 0..pivots {
                for line in 0..pivots {
                    let found = case.panel[column * stride + line];
                    assert!((found - factor[(line, column)]).abs() < 1e-12, "{pivots}+{border}");
                }
                for line in 0..border {
                    let found = case.panel[column * stride + padded(pivots) + line];
                    assert!((found - of_border[(column, line)]).abs() < 1e-12);
                }
            }
            let update = -of_border.transpose() * &of_border;
            for column in 0..border {
                for line in column..border {
                    let found = case.update[column * padded(border) + line];
                    assert!((found - update[(line, column)]).abs() < 1e-11, "{pivots}+{border}");
                }
            }
        }
    }
}

#[test]
fn solves_are_those_of_dense_algebra() {
    for mut case in cases() {
        let (pivots, border, stride) = (case.pivots, case.border, case.stride());
        case.factorise(false).expect("positive definite");
        let line = |line: usize| line_of(line, pivots);
        let factor = DMatrix::from_fn(pivots + border, pivots, |row, column| {
            case.panel[column * stride + line(row)]
        });
        let mut random = uniform(pivots as u64);
        let right = DVector::from_fn(pivots + border, |_, _| random());
        let forward = factor.rows(0, pivots).solve_lower_triangular(&right.rows(0, pivots));
        let forward = forward.expect("regular");
        let change = -factor.rows(pivots, border) * &forward;
        for scalar in [false, true] {
            let mut side = vec![0.0; stride];
            (0..pivots).for_each(|k| side[k] = right[k]);
            let work = Forward { panel: &case.panel, stride, pivots, side: &mut side };
            if scalar {
                work.with_simd(pulp::Scalar)
            } else {
                pulp::Arch::new().dispatch(work)
            }
            for k in 0..pivots + border {
                let expected = if k < pivots { forward[k] } else { change[k - pivots] };
                assert!((side[line(k)] - expected).abs() < 1e-11, "{pivots}+{border}, {k}");
            }

            let mut side = vec![0.0; stride];
            (0..pivots + border).for_each(|k| side[line(k)] = right[k]);
            let of_border = factor.rows(pivots, border).tr_mul(&right.rows(pivots, border));
            let expected = factor
                .rows(0, pivots)
                .tr_solve_lower_triangular(&(right.rows(0, pivots) - of_border))
                .expect("regular");
            let work = Backward { panel: &case.panel, stride, pivots, side: &mut side };
            if scalar {
                work.with_simd(pulp::Scalar)
            } else {
                pulp::Arch::new().dispatch(work)
            }
            (0..pivots).for_each(|k| assert!((side[k] - expected[k]).abs() < 1e-11));
        }
    }
}

#[test]
fn a_panel_that_is_not_positive_definite_is_refused() {
    for wrong in [0.0, -1.0, f64::NAN] {
        let mut case = Case::new(13, 5);
        let stride = case.stride();
        case.panel[11 * (stride + 1)] = wrong;
        assert!(case.factorise(false).is_none(), "{wrong}");
    }
}
