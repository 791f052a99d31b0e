//! Conversion of rows of values to NumPy arrays. Each array is a copy: writing into one does not change the plan.

use numpy::ndarray::{Array1, Array2, Array3};
use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyArray3};
use pyo3::{Py, Python};

/// `values[n]` as an array of shape (N,).
pub fn vector<T: Element>(py: Python<'_>, values: Vec<T>) -> Py<PyArray1<T>> {
    Array1::from_vec(values).into_pyarray(py).unbind()
}

/// `value(row, column)` as an array of shape (rows, columns).
pub fn matrix<T: Element>(
    py: Python<'_>,
    [rows, columns]: [usize; 2],
    value: impl Fn(usize, usize) -> T,
) -> Py<PyArray2<T>> {
    Array2::from_shape_fn((rows, columns), |(row, column)| value(row, column))
        .into_pyarray(py)
        .unbind()
}

/// `value(row, item, axis)` as an array of shape (rows, items, 3).
pub fn vectors(
    py: Python<'_>,
    [rows, items]: [usize; 2],
    value: impl Fn(usize, usize, usize) -> f64,
) -> Py<PyArray3<f64>> {
    Array3::from_shape_fn((rows, items, 3), |(row, item, axis)| value(row, item, axis))
        .into_pyarray(py)
        .unbind()
}
