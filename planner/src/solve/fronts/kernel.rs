//! Dense kernels of one front: factorisation of its panel, and the two triangular solves.
//!
//! Columns have padded lengths, so that the kernels process whole vectors. Tiles of three vectors by up to eight columns keep
//! their sums in registers. Sums have the same order for every vector width, hence all processors with fused multiplication
//! compute the same digits.

use pulp::{Simd, WithSimd};

/// Multiple to which the numbers of pivots and border lines are padded: the lanes of the widest vectors.
pub(super) const PAD: usize = 8;
/// Number of columns that are factorised together.
const BLOCK: usize = 8;
/// Number of partial sums of a scalar product.
const PARTS: usize = 4 * PAD;

/// Returns the padded number of lines.
pub(super) fn padded(lines: usize) -> usize {
    lines.next_multiple_of(PAD)
}

/// Returns a·b + c. Processors without fused multiplication would emulate it slowly.
#[inline(always)]
fn multiply_add<S: Simd>(simd: S, a: S::f64s, b: S::f64s, c: S::f64s) -> S::f64s {
    if S::F64_LANES >= 4 || cfg!(target_arch = "aarch64") {
        simd.mul_add_f64s(a, b, c)
    } else {
        simd.add_f64s(simd.mul_f64s(a, b), c)
    }
}

#[inline(always)]
fn load<S: Simd>(entries: &[f64], at: usize) -> S::f64s {
    S::as_simd_f64s(&entries[at..at + S::F64_LANES]).0[0]
}

#[inline(always)]
fn store<S: Simd>(entries: &mut [f64], at: usize, vector: S::f64s) {
    S::as_mut_simd_f64s(&mut entries[at..at + S::F64_LANES]).0[0] = vector;
}

/// Columns of a matrix, with the distance between their first entries.
#[derive(Clone, Copy)]
struct Columns<'a> {
    entries: &'a [f64],
    stride: usize,
    count: usize,
}

impl<'a> Columns<'a> {
    /// Returns the columns without their first lines.
    #[inline(always)]
    fn below(self, line: usize) -> Self {
        Self { entries: &self.entries[line..], ..self }
    }
}

/// Computes C ← C − A·Bᵀ for `M` vectors of lines and `N` columns of C, or −A·Bᵀ if `REPLACE` is set. The first line of B
/// belongs to the first column of C.
#[inline(always)]
fn tile<S: Simd, const M: usize, const N: usize, const REPLACE: bool>(
    simd: S,
    a: Columns<'_>,
    b: Columns<'_>,
    c: &mut [f64],
    c_stride: usize,
) {
    let lanes = S::F64_LANES;
    let mut sums = [[simd.splat_f64s(0.0); M]; N];
    for k in 0..a.count {
        let lines = &a.entries[k * a.stride..][..M * lanes];
        let factors = &b.entries[k * b.stride..][..N];
        let lines: [S::f64s; M] = std::array::from_fn(|i| load::<S>(lines, i * lanes));
        for j in 0..N {
            let factor = simd.splat_f64s(factors[j]);
            for i in 0..M {
                sums[j][i] = multiply_add(simd, lines[i], factor, sums[j][i]);
            }
        }
    }
    for j in 0..N {
        let column = &mut c[j * c_stride..][..M * lanes];
        for i in 0..M {
            let sum = if REPLACE {
                simd.neg_f64s(sums[j][i])
            } else {
                simd.sub_f64s(load::<S>(column, i * lanes), sums[j][i])
            };
            store::<S>(column, i * lanes, sum);
        }
    }
}

/// Computes tiles for `N` columns and all lines, whose number is a multiple of [`PAD`].
#[inline(always)]
fn strip<S: Simd, const N: usize, const REPLACE: bool>(
    simd: S,
    a: Columns<'_>,
    b: Columns<'_>,
    c: &mut [f64],
    c_stride: usize,
    lines: usize,
) {
    let lanes = S::F64_LANES;
    let mut line = 0;
    while line + 3 * lanes <= lines {
        tile::<S, 3, N, REPLACE>(simd, a.below(line), b, &mut c[line..], c_stride);
        line += 3 * lanes;
    }
    while line < lines {
        tile::<S, 1, N, REPLACE>(simd, a.below(line), b, &mut c[line..], c_stride);
        line += lanes;
    }
}

/// Lower triangle of a diagonal block, by columns, and the reciprocals of its diagonal.
struct Diagonal {
    entries: [[f64; BLOCK]; BLOCK],
    inverse: [f64; BLOCK],
}

impl Diagonal {
    /// Factorises the lower triangle of the first `count` columns. Returns `None` if a pivot is not positive.
    #[inline(always)]
    fn factorise(mut entries: [[f64; BLOCK]; BLOCK], count: usize) -> Option<Self> {
        let mut inverse = [0.0; BLOCK];
        for j in 0..count {
            let pivot = entries[j][j];
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let root = pivot.sqrt();
            inverse[j] = root.recip();
            entries[j][j] = root;
            for i in j + 1..count {
                entries[j][i] *= inverse[j];
            }
            for k in j + 1..count {
                let factor = entries[j][k];
                for i in k..count {
                    entries[k][i] -= factor * entries[j][i];
                }
            }
        }
        Some(Self { entries, inverse })
    }

    /// Solves X·Lᵀ = A in place for the vector of lines at `line` in `count` columns.
    #[inline(always)]
    fn solve<S: Simd>(&self, simd: S, block: &mut [f64], stride: usize, line: usize, count: usize) {
        let mut x = [simd.splat_f64s(0.0); BLOCK];
        for j in 0..count {
            x[j] = load::<S>(block, j * stride + line);
        }
        for j in 0..count {
            x[j] = simd.mul_f64s(x[j], simd.splat_f64s(self.inverse[j]));
            let minus = simd.neg_f64s(x[j]);
            for k in j + 1..count {
                x[k] = multiply_add(simd, minus, simd.splat_f64s(self.entries[j][k]), x[k]);
            }
        }
        for j in 0..count {
            store::<S>(block, j * stride + line, x[j]);
        }
    }
}

/// Computes C ← C − A·Bᵀ, or −A·Bᵀ if `REPLACE` is set, for `columns` columns and `lines` lines of C.
#[inline(always)]
fn product<S: Simd, const REPLACE: bool>(
    simd: S,
    [a, b]: [Columns<'_>; 2],
    c: &mut [f64],
    c_stride: usize,
    [columns, lines]: [usize; 2],
) {
    let mut j = 0;
    while j < columns {
        let (b, c) = (b.below(j), &mut c[j * c_stride..]);
        // Sums of 8 columns fit into 32 registers, of 4 columns into 16.
        if S::F64_LANES >= 8 && columns - j >= 8 {
            strip::<S, 8, REPLACE>(simd, a, b, c, c_stride, lines);
            j += 8;
        } else if columns - j >= 4 {
            strip::<S, 4, REPLACE>(simd, a, b, c, c_stride, lines);
            j += 4;
        } else {
            strip::<S, 1, REPLACE>(simd, a, b, c, c_stride, lines);
            j += 1;
        }
    }
}

/// Cholesky factorisation of a front: its panel in place, and its update matrix −L·Lᵀ on the border.
///
/// A column of the panel has the pivots, padded, then the border, padded. Entries above the diagonal of the factor are zero.
pub(super) struct Factorise<'a> {
    pub panel: &'a mut [f64],
    /// Length of a column of the panel.
    pub stride: usize,
    pub pivots: usize,
    /// Lower triangle of the update matrix, with as many columns and lines as the padded border.
    pub update: &'a mut [f64],
}

impl WithSimd for Factorise<'_> {
    /// Result; `None` if a pivot is not positive.
    type Output = Option<()>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<()> {
        let Self { panel, stride, pivots, update } = self;
        let lanes = S::F64_LANES;
        for first in (0..pivots).step_by(BLOCK) {
            let count = BLOCK.min(pivots - first);
            let (before, block) = panel.split_at_mut(first * stride);
            let block = &mut block[..count * stride];
            let earlier = Columns { entries: before, stride, count: first };
            if first > 0 {
                let earlier = earlier.below(first);
                let size = [count, stride - first];
                product::<S, false>(simd, [earlier; 2], &mut block[first..], stride, size);
            }
            let mut entries = [[0.0; BLOCK]; BLOCK];
            for (j, column) in entries.iter_mut().enumerate().take(count) {
                column[j..count].copy_from_slice(&block[j * stride + first..][j..count]);
            }
            let diagonal = Diagonal::factorise(entries, count)?;
            for line in (first..stride).step_by(lanes) {
                // A constant number of columns lets the compiler unroll the loops.
                if count == BLOCK {
                    diagonal.solve(simd, block, stride, line, BLOCK);
                } else {
                    diagonal.solve(simd, block, stride, line, count);
                }
            }
            for (j, column) in diagonal.entries.iter().enumerate().take(count) {
                let lines = &mut block[j * stride + first..][..count];
                lines.copy_from_slice(&column[..count]);
                lines[..j].fill(0.0);
            }
        }
        let head = padded(pivots);
        let width = stride - head;
        let border = Columns { entries: panel, stride, count: pivots }.below(head);
        for first in (0..width).step_by(PAD) {
            let own = border.below(first);
            let c = &mut update[first * width + first..];
            product::<S, true>(simd, [own; 2], c, width, [PAD, width - first]);
        }
        Some(())
    }
}

/// Forward solve with one front. `side` has the pivots, padding, and zeros for the border, to which the changes of the border
/// are added.
pub(super) struct Forward<'a> {
    pub panel: &'a [f64],
    pub stride: usize,
    pub pivots: usize,
    pub side: &'a mut [f64],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { panel, stride, pivots, side } = self;
        let lanes = S::F64_LANES;
        for (k, column) in panel.chunks_exact(stride).enumerate().take(pivots) {
            let x = side[k] / column[k];
            // Lines above the diagonal are zero, and the entry of the pivot is set afterwards.
            let from = k / lanes * lanes;
            let minus = simd.splat_f64s(-x);
            let (factors, _) = S::as_simd_f64s(&column[from..]);
            let (lines, _) = S::as_mut_simd_f64s(&mut side[from..stride]);
            for (line, factor) in lines.iter_mut().zip(factors) {
                *line = multiply_add(simd, minus, *factor, *line);
            }
            side[k] = x;
        }
    }
}

/// Backward solve with one front. `side` has the pivots, zeros as padding, and the solution on the border.
pub(super) struct Backward<'a> {
    pub panel: &'a [f64],
    pub stride: usize,
    pub pivots: usize,
    pub side: &'a mut [f64],
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { panel, stride, pivots, side } = self;
        for (k, column) in panel.chunks_exact(stride).enumerate().take(pivots).rev() {
            let own = std::mem::replace(&mut side[k], 0.0);
            let from = k / PAD * PAD;
            let product = scalar_product(simd, &column[from..], &side[from..stride]);
            side[k] = (own - product) / column[k];
        }
    }
}

/// Scalar product of vectors with a multiple of [`PAD`] entries. The order of the sum does not depend on the vector width.
#[inline(always)]
fn scalar_product<S: Simd>(simd: S, a: &[f64], b: &[f64]) -> f64 {
    let lanes = S::F64_LANES;
    let mut parts = [0.0; PARTS];
    for first in (0..PARTS.min(a.len())).step_by(lanes) {
        let mut sum = simd.splat_f64s(0.0);
        for at in (first..a.len()).step_by(PARTS) {
            sum = multiply_add(simd, load::<S>(a, at), load::<S>(b, at), sum);
        }
        store::<S>(&mut parts, first, sum);
    }
    let mut count = PARTS;
    while count > 1 {
        count /= 2;
        for k in 0..count {
            parts[k] += parts[k + count];
        }
    }
    parts[0]
}

#[cfg(test)]
mod tests;
