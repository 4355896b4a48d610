//! The rows of a form-finding problem: which constraints there are, and what they are called.

use nalgebra::Vector3;
use tensegra_atlas::{ImplicitManifold, SparseRow};
use tensegra_collision::Solid;
use tensegra_model::{
    Actuation, Body, Environment, EquilibriumManifold, FormCondition, FormSettings, FreeSpace,
    Interval, NodesManifold, Stability,
};

use crate::cylinders::Cylinders;

/// What a constraint is about; the rows of a group are relaxed together when a cause is sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Group {
    /// Conditions on the form.
    Conditions,
    /// Stability.
    Stability,
    /// Clearances.
    Clearance,
    /// Force balance.
    Balance,
    /// Rest lengths and forces: their ranges, pretension, and couplings.
    Forces,
    /// Lengths: constant ones, their ranges, coupled lengths and directions.
    Lengths,
}

impl Group {
    const fn geometric(is_geometric: bool) -> Self {
        if is_geometric {
            Self::Lengths
        } else {
            Self::Forces
        }
    }
}

/// One row of the programme.
#[derive(Clone, Debug)]
pub(crate) enum Row {
    Equation(usize),
    Limit(usize),
    Contact(usize),
    Cylinders(Cylinders),
    NodeObstacle { node: usize, solid: usize },
    Point { condition: usize, axis: usize },
    Condition(usize),
    Image { condition: usize, axis: usize },
    Stiffness,
}

/// A row with what it is compared with and what it depends on.
#[derive(Clone, Debug)]
pub(crate) struct RowData {
    pub(crate) row: Row,
    pub(crate) group: Group,
    pub(crate) range: Interval,
    pub(crate) columns: Vec<usize>,
}

/// What does not change between the solves of one form-finding problem.
pub(crate) struct Frame<'a> {
    pub(crate) manifold: &'a NodesManifold,
    pub(crate) free: FreeSpace<'a, NodesManifold>,
    pub(crate) settings: &'a FormSettings,
    pub(crate) conditions: &'a [FormCondition],
    pub(crate) solids: &'a [(usize, Solid)],
    pub(crate) environment: &'a Environment,
    pub(crate) stability: Stability<'a>,
    pub(crate) rows: Vec<RowData>,
    pub(crate) stiffness_unit: f64,
}

impl<'a> Frame<'a> {
    pub(crate) fn new(
        manifold: &'a NodesManifold,
        free: FreeSpace<'a, NodesManifold>,
        environment: &'a Environment,
        settings: &'a FormSettings,
        conditions: &'a [FormCondition],
        solids: &'a [(usize, Solid)],
    ) -> Self {
        let stability = Stability::new(manifold.structure(), Actuation::Length);
        let mut frame = Self {
            manifold,
            free,
            settings,
            conditions,
            solids,
            environment,
            stability,
            rows: Vec::new(),
            stiffness_unit: manifold.force_unit() / manifold.size(),
        };
        frame.rows = frame.all_rows();
        frame
    }

    fn all_rows(&self) -> Vec<RowData> {
        let structure = self.manifold.structure();
        let n = self.manifold.ambient_dimension();
        let size = self.manifold.size();
        let mut rows = Vec::new();
        let equal = Interval::constant(0.0);
        let above = |least: f64| Interval::new(least, f64::INFINITY);
        for equation in 0..self.manifold.equation_count() {
            let columns = self.manifold.jacobian_pattern().row(equation).to_vec();
            rows.push(RowData {
                row: Row::Equation(equation),
                group: if equation < self.manifold.balance_count() {
                    Group::Balance
                } else {
                    Group::geometric(self.manifold.equation_is_geometric(equation))
                },
                range: equal,
                columns,
            });
        }
        // At a point in general position no entry of a gradient vanishes by chance.
        let generic: Vec<f64> = (0..n).map(|i| (1.0 + 2.3 * i as f64).sin() + 0.1).collect();
        let mut sparse = SparseRow::default();
        for limit in 0..self.manifold.limit_count() {
            sparse.clear();
            self.manifold.limit_gradient(limit, &generic, &mut sparse);
            rows.push(RowData {
                row: Row::Limit(limit),
                group: Group::geometric(self.manifold.limit_is_geometric(limit)),
                range: above(0.0),
                columns: columns_of(&sparse),
            });
        }
        let by_nodes = |nodes: &[usize]| self.columns_of_nodes(nodes);
        let least = self.settings.clearance / size;
        for contact in 0..self.free.contact_count() {
            let cylinders = if self.settings.infinite_cylinders {
                Cylinders::of(
                    structure,
                    self.free.bodies(contact),
                    self.settings.clearance,
                    size,
                )
            } else {
                None
            };
            let row = match cylinders {
                Some(cylinders) => Row::Cylinders(cylinders),
                None => Row::Contact(contact),
            };
            let range = match row {
                Row::Cylinders(_) => above(0.0),
                _ => above(least),
            };
            rows.push(RowData {
                row,
                group: Group::Clearance,
                range,
                columns: by_nodes(&self.free.contact_nodes(contact)),
            });
        }
        if let Some(radius) = self.settings.node_radius {
            for node in 0..structure.nodes.len() {
                let columns = by_nodes(&[node]);
                if columns.is_empty() {
                    continue;
                }
                for solid in 0..self.solids.len() {
                    rows.push(RowData {
                        row: Row::NodeObstacle { node, solid },
                        group: Group::Clearance,
                        range: above(radius / size),
                        columns: columns.clone(),
                    });
                }
            }
        }
        for (condition, stated) in self.conditions.iter().enumerate() {
            let mut add = |row, range, columns| {
                rows.push(RowData {
                    row,
                    group: Group::Conditions,
                    range,
                    columns,
                });
            };
            let scaled =
                |range: &Interval, unit: f64| Interval::new(range.lo / unit, range.hi / unit);
            match stated {
                FormCondition::Point { of, at } => {
                    let nodes: Vec<usize> = of.iter().map(|&(node, _)| node).collect();
                    for (axis, value) in at.iter().enumerate() {
                        if let Some(value) = value {
                            let range = scaled(value, size);
                            let columns = by_nodes(&nodes);
                            add(Row::Point { condition, axis }, range, columns);
                        }
                    }
                }
                FormCondition::Distance { nodes, range } => {
                    let range = scaled(range, size);
                    add(Row::Condition(condition), range, by_nodes(nodes));
                }
                FormCondition::Length { element, range } => {
                    let nodes = structure.elements[*element].nodes;
                    let range = scaled(range, size);
                    add(Row::Condition(condition), range, by_nodes(&nodes));
                }
                FormCondition::RestLength { element, range } => {
                    let range = scaled(range, size);
                    add(
                        Row::Condition(condition),
                        range,
                        self.columns_of_force(*element),
                    );
                }
                FormCondition::Force { element, range } => {
                    let range = scaled(range, self.manifold.force_unit());
                    add(
                        Row::Condition(condition),
                        range,
                        self.columns_of_force(*element),
                    );
                }
                FormCondition::EqualLengths { elements } => {
                    let nodes = elements.map(|e| structure.elements[e].nodes).concat();
                    add(Row::Condition(condition), equal, by_nodes(&nodes));
                }
                FormCondition::Image { nodes, .. } => {
                    for axis in 0..structure.dimension {
                        let columns = by_nodes(nodes);
                        add(Row::Image { condition, axis }, equal, columns);
                    }
                }
                _ => {}
            }
        }
        if let Some(least) = self.settings.least_stiffness {
            rows.push(RowData {
                row: Row::Stiffness,
                group: Group::Stability,
                range: above(least / self.stiffness_unit),
                columns: (0..n).collect(),
            });
        }
        rows
    }

    fn columns_of_nodes(&self, nodes: &[usize]) -> Vec<usize> {
        let mut row = SparseRow::default();
        let ones: Vec<(usize, Vector3<f64>)> = nodes
            .iter()
            .map(|&node| (node, Vector3::repeat(1.0)))
            .collect();
        self.manifold.pull_back(&[], &ones, &mut row);
        columns_of(&row)
    }

    /// Variables on which length and force density of an element depend.
    fn columns_of_force(&self, element: usize) -> Vec<usize> {
        let mut columns = self.columns_of_nodes(&self.manifold.structure().elements[element].nodes);
        let mut row = SparseRow::default();
        let origin = vec![0.0; self.manifold.ambient_dimension()];
        self.manifold
            .force_density_gradient(element, &origin, 1.0, &mut row);
        columns.extend(columns_of(&row));
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// The settings of form-finding.
    pub(crate) fn settings(&self) -> &'a FormSettings {
        self.settings
    }

    /// Group of a row.
    pub(crate) fn group(&self, row: usize) -> Group {
        self.rows[row].group
    }

    /// Group of the range of a variable.
    pub(crate) fn group_of_variable(&self, variable: usize) -> Group {
        Group::geometric(self.manifold.variable_is_geometric(variable))
    }

    /// A row in words, and the unit of its value.
    pub(crate) fn describe(&self, row: usize) -> (String, f64) {
        let structure = self.manifold.structure();
        let size = self.manifold.size();
        match &self.rows[row].row {
            Row::Equation(equation) => (
                self.manifold.equation_name(*equation),
                self.manifold.equation_unit(*equation),
            ),
            Row::Limit(limit) => (
                self.manifold.limit_name(*limit),
                self.manifold.limit_unit(*limit),
            ),
            Row::Contact(contact) => {
                let [a, b] = self.free.bodies(*contact).map(|body| self.body_name(body));
                (format!("clearance of {a} and {b}"), size)
            }
            Row::Cylinders(cylinders) => {
                let [a, b] = cylinders
                    .elements
                    .map(|e| structure.elements[e].name.as_str());
                (
                    format!("clearance of the infinite cylinders {a} and {b}"),
                    size,
                )
            }
            Row::NodeObstacle { node, solid } => {
                let node = &structure.nodes[*node].name;
                let obstacle = &self.environment.obstacles[self.solids[*solid].0].name;
                (format!("clearance of node {node} and {obstacle}"), size)
            }
            Row::Point { condition, axis } => {
                let FormCondition::Point { of, at } = &self.conditions[*condition] else {
                    return (String::new(), size);
                };
                let mut only = [None; 3];
                only[*axis] = at[*axis];
                let point = FormCondition::Point {
                    of: of.clone(),
                    at: only,
                };
                (point.describe(structure), size)
            }
            Row::Condition(condition) | Row::Image { condition, .. } => {
                let stated = &self.conditions[*condition];
                let unit = match stated {
                    FormCondition::Force { .. } => self.manifold.force_unit(),
                    _ => size,
                };
                (stated.describe(structure), unit)
            }
            Row::Stiffness => (
                "stability: the smallest eigenvalue of the tangent stiffness".to_owned(),
                self.stiffness_unit,
            ),
        }
    }

    /// A variable in words, and the unit of its value.
    pub(crate) fn describe_variable(&self, variable: usize) -> String {
        format!("range of the {}", self.manifold.variable_name(variable))
    }

    fn body_name(&self, body: Body) -> &str {
        let structure = self.manifold.structure();
        match body {
            Body::Element(e) => &structure.elements[e].name,
            Body::Attachment(a) => &structure.attachments[a].name,
            Body::Obstacle(o) => &self.environment.obstacles[o].name,
        }
    }
}

fn columns_of(row: &SparseRow) -> Vec<usize> {
    let mut columns: Vec<usize> = row.entries().iter().map(|&(column, _)| column).collect();
    columns.sort_unstable();
    columns.dedup();
    columns
}
