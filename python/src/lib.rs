//! horma for Python: a tool path from arrays, as `horma run` computes it from files.
//!
//! This crate turns arrays into a part and a path into an array, and does nothing else: it reads no file,
//! and what is said of cutter and motion is read by the reader of job files.

use pyo3::pymodule;

/// Tool paths for shoe lasts and other free-form parts turned on copying lathes, by virtual digitizing.
#[pymodule(name = "horma")]
mod module {
    #[pymodule_export]
    use super::digitize;

    use horma_formats::columns;
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        let names: Vec<&str> = columns::names().collect();
        module.add("COLUMNS", PyTuple::new(module.py(), names)?)
    }
}

use std::path::Path;

use horma_core::{
    Body, Digitizer, Job, Mesh, Model, Part, Plan, Point, Shape, Simd, ToolPath, discretize,
};
use horma_formats::{columns, job};
use numpy::ndarray::{Array2, ArrayView2, ArrayView3};
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

/// What points are like, for messages.
const GRID: &str = "points are an array of (rows, columns, 3) float64, or a list of those";

/// digitize(*, triangles=None, points=None, cutter, motion, digitizing=None, threads=None)
///
/// Where the centre of the cutter has to stand at each position of a spiral around the part: as close as it
/// can come along the attack axis, and never deeper.
///
/// The part lies around the X axis, which is the spindle. Lengths are in mm, angles in degrees.
///
/// triangles : (n, 3, 3) float64
///     Corners of the part's facets, which are taken as they are: nothing is healed.
/// points : (rows, columns, 3) float64, or a list of such arrays
///     Grids of points; the rows follow each other along the spindle, and each runs around it. Between them the part is taken as facets, or not at
///     all if digitizing={"contact": "point"}.
/// cutter, motion, digitizing : dict
///     The tables of a job file, e.g. {"kind": "torus", "major_radius": 40.0, "minor_radius": 8.0} and
///     {"step": 2.0, "points_per_revolution": 360}.
/// threads : int
///     Threads to compute on; the path does not depend on it. Default: all cores.
///
/// Returns an array of (positions, 7) float64, its columns named by COLUMNS: the lines of path.csv. y and the
/// contact are NaN where nothing is in reach.
///
/// Raises ValueError if what is given is wrong, RuntimeError if it cannot be done.
#[pyfunction]
#[pyo3(signature = (*, triangles=None, points=None, cutter, motion, digitizing=None, threads=None))]
fn digitize<'py>(
    py: Python<'py>,
    triangles: Option<PyReadonlyArray3<'py, f64>>,
    points: Option<Bound<'py, PyAny>>,
    cutter: &Bound<'py, PyDict>,
    motion: &Bound<'py, PyDict>,
    digitizing: Option<&Bound<'py, PyDict>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let tables = [
        ("cutter", Some(cutter)),
        ("motion", Some(motion)),
        ("digitizing", digitizing),
    ];
    let job = job(py, &tables)?;
    let model = match (triangles, points) {
        (Some(triangles), None) => mesh(triangles.as_array(), job)?,
        (None, Some(points)) => grids(&points)?,
        _ => return Err(PyTypeError::new_err("give either triangles or points")),
    };
    let threads = threads.unwrap_or(0);
    let path = py.detach(|| compute(model, job, threads))?;
    Ok(rows(&path).into_pyarray(py))
}

/// Facets by their corners.
fn mesh(triangles: ArrayView3<f64>, job: Job) -> PyResult<Model> {
    let shape = triangles.shape();
    if shape[1..] != [3, 3] {
        return Err(PyValueError::new_err(format!(
            "triangles are an array of (n, 3, 3) float64, not {shape:?}"
        )));
    }
    let corners = triangles
        .outer_iter()
        .map(|triangle| [0, 1, 2].map(|i| [0, 1, 2].map(|j| triangle[[i, j]])));
    let name = "triangles";
    let mesh = Mesh::of_corners(name, corners).map_err(refused)?;
    let body = Body {
        name: name.to_owned(),
        shape: Shape::Mesh(mesh),
    };
    discretize(&Part { bodies: vec![body] }, job.discretization).map_err(refused)
}

/// Grids of points, as they are.
fn grids(points: &Bound<'_, PyAny>) -> PyResult<Model> {
    let one = |any: &Bound<'_, PyAny>| -> PyResult<Vec<Vec<Point>>> {
        let array: PyReadonlyArray3<f64> = any.extract().map_err(|_| PyTypeError::new_err(GRID))?;
        let array = array.as_array();
        if array.shape()[2] != 3 {
            return Err(PyValueError::new_err(format!(
                "{GRID}, not {:?}",
                array.shape()
            )));
        }
        let row =
            |row: ArrayView2<f64>| row.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
        Ok(array.outer_iter().map(row).collect())
    };
    let grids = if points.is_instance_of::<PyList>() || points.is_instance_of::<PyTuple>() {
        let all = points.try_iter()?.map(|item| one(&item?));
        all.collect::<PyResult<Vec<_>>>()?
    } else {
        vec![one(points)?]
    };
    Model::of_grids(&grids).map_err(refused)
}

/// The job that these tables describe, as if they stood in a file.
fn job(py: Python<'_>, tables: &[(&str, Option<&Bound<'_, PyDict>>)]) -> PyResult<Job> {
    let json = py.import(intern!(py, "json"))?;
    // Numbers of NumPy tell what they are to Python.
    let item = py.import(intern!(py, "operator"))?;
    let item = item.call_method1(intern!(py, "methodcaller"), ("item",))?;
    let how = PyDict::new(py);
    how.set_item("default", item)?;
    let mut text = "part.files = [\"-\"]\n".to_owned();
    for (name, table) in tables {
        let Some(table) = table else {
            continue;
        };
        let table = json.call_method(intern!(py, "dumps"), (table,), Some(&how))?;
        let table: toml::Table = serde_json::from_str(&table.extract::<String>()?)
            .map_err(|e| PyValueError::new_err(format!("{name}: {e}")))?;
        let table = toml::Table::from_iter([((*name).to_owned(), toml::Value::Table(table))]);
        text += &toml::to_string(&table).map_err(|e| PyValueError::new_err(e.to_string()))?;
    }
    let file = job::parse(&text, Path::new("digitize()"), &job::Overrides::default());
    Ok(file.map_err(wrong)?.job)
}

/// Digitizes a part on so many threads; 0: one for each core.
fn compute(model: Model, job: Job, threads: usize) -> PyResult<ToolPath> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
    let path = pool.install(|| {
        // Python's own arrays are not measured beforehand either.
        let plan = Plan::over(model, job, u64::MAX)?;
        let digitizer = Digitizer::new(&job, &plan.model.rows, Simd::best());
        Ok(digitizer.path(&plan.trajectory).0)
    });
    path.map_err(refused)
}

/// The lines of path.csv.
fn rows(path: &ToolPath) -> Array2<f64> {
    let line = |w| columns::of(&w).map(|n| n.unwrap_or(f64::NAN));
    Array2::from(path.waypoints().map(line).collect::<Vec<_>>())
}

fn wrong(error: horma_formats::Error) -> PyErr {
    match error.is_impossible() {
        true => PyRuntimeError::new_err(error.to_string()),
        false => PyValueError::new_err(error.to_string()),
    }
}

fn refused(error: horma_core::Error) -> PyErr {
    match error.is_impossible() {
        true => PyRuntimeError::new_err(error.to_string()),
        false => PyValueError::new_err(error.to_string()),
    }
}
