//! MJCF, the models of MuJoCo, as the links and joints of a URDF: <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.
//!
//! `model` has the settings and classes of defaults. `numbers` reads attributes and poses, `geoms` solids and their masses,
//! `bodies` the tree, `springs` the springs of joints, `loops` cranks and rods, `home` the standing pose. `dropped` names
//! elements that robot files lack. As in URDF, the frame of a link is that of its joint: the reader moves a body to the anchor of
//! its joint. Meshes and included files are not read.

mod bodies;
mod couplings;
mod dropped;
mod geoms;
mod home;
mod loops;
mod model;
mod numbers;
mod springs;

use super::model::Urdf;
use super::notes::Notes;
use crate::document::DocumentError;
use model::Model;
use numbers::Reader;
use roxmltree::Node;

/// Maximum number of classes of defaults. Models have a few dozen.
const CLASSES_MAX: usize = 1000;
/// Lists that the reader uses.
const READ: [&str; 4] = ["worldbody", "actuator", "equality", "tendon"];
/// Maximum number of elements of a list: ten for each body.
const ELEMENTS_MAX: usize = 20_000;
/// Elements that MuJoCo replaces by others.
const MACROS: [&str; 5] = ["include", "attach", "replicate", "composite", "flexcomp"];
const SAVE: &str = "let MuJoCo write the whole model: \
                    `mujoco.mj_saveLastXML(\"whole.xml\", mujoco.MjModel.from_xml_path(\"robot.xml\"))`";

/// Reads the elements of a model whose root is `<mujoco>`.
pub(super) fn read(root: Node<'_, '_>, notes: &mut Notes<'_>) -> Result<Urdf, DocumentError> {
    let model = Model::new(root);
    let mut reader = Reader { notes, model: &model };
    for node in root.descendants().filter(|node| MACROS.contains(&node.tag_name().name())) {
        reader.fault(node, format!("<{}> stands for other elements", node.tag_name().name()), SAVE);
    }
    if let Some(compiler) = model.global {
        let help = "convert the model with an older MuJoCo: from 2.3.3 on, MuJoCo reads local coordinates only";
        reader.fault(compiler, "the model has global coordinates", help);
    }
    if let Some(compiler) = model.scaled {
        reader.fault(compiler, "`settotalmass`, which scales all masses, is not supported", SAVE);
    }
    let classes = model.classes().len();
    if classes > CLASSES_MAX {
        let message = format!("the model has {classes} classes of defaults");
        let help = format!("check the path: the import reads at most {CLASSES_MAX}");
        reader.fault(root, message, &help);
    }
    for list in root.children().filter(|node| READ.contains(&node.tag_name().name())) {
        let count = list.descendants().filter(Node::is_element).count();
        if count > ELEMENTS_MAX {
            let message = format!("<{}> has {count} elements", list.tag_name().name());
            let help = format!("check the path: the import reads at most {ELEMENTS_MAX}");
            reader.fault(list, message, &help);
        }
    }
    reader.notes.check()?;
    let (urdf, closed) = bodies::read(root, &mut reader);
    dropped::warn(root, &closed, &mut reader);
    reader.notes.check()?;
    if urdf.links.is_empty() {
        reader.fault(root, "the model has no <body>", "a robot is a <body> of <worldbody>");
    }
    reader.notes.check()?;
    Ok(urdf)
}
