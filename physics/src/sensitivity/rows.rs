//! Sparse matrices in compressed rows, for records.

/// Sparse matrix that supports products only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rows {
    /// End index of each row.
    ends: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Rows {
    /// Adds an entry to the present row.
    pub fn push(&mut self, column: usize, value: f64) {
        if value != 0.0 {
            self.columns.push(column as u32);
            self.values.push(value);
        }
    }

    /// Ends the present row.
    pub fn end_row(&mut self) {
        self.ends.push(self.values.len() as u32);
    }

    fn rows(&self) -> impl Iterator<Item = (&[u32], &[f64])> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| {
            let range = start as usize..end as usize;
            (&self.columns[range.clone()], &self.values[range])
        })
    }

    /// Subtracts the product of the matrix and several vectors.
    pub fn subtract_product<const W: usize>(&self, with: &[[f64; W]], from: &mut [[f64; W]]) {
        for ((columns, values), lanes) in self.rows().zip(from) {
            let mut sum = *lanes;
            for (&column, value) in columns.iter().zip(values) {
                for (sum, part) in sum.iter_mut().zip(&with[column as usize]) {
                    *sum -= value * part;
                }
            }
            *lanes = sum;
        }
    }

    /// Subtracts the product of the transposed matrix and a vector.
    pub fn subtract_transposed(&self, with: &[f64], from: &mut [f64]) {
        for ((columns, values), part) in self.rows().zip(with) {
            for (&column, value) in columns.iter().zip(values) {
                from[column as usize] -= value * part;
            }
        }
    }
}
