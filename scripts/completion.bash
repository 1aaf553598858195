# Completion of tendril's options for bash: source scripts/completion.bash
# Written by `scripts/docs` from the table in `include/tendril/io/keys.hpp`; do not edit.
_tendril() {
  local word=${COMP_WORDS[COMP_CWORD]} last=${COMP_WORDS[COMP_CWORD-1]}
  case $last in
    -mode) COMPREPLY=($(compgen -W 'dynamic static modes buckling' -- "$word"));;
    -integrator) COMPREPLY=($(compgen -W 'euler bdf2 bdf3 sdirk2 sdirk23 sdirk33 midpoint symplectic2 energy_momentum generalized_alpha' -- "$word"));;
    -dt_adapt) COMPREPLY=($(compgen -W 'none error' -- "$word"));;
    -continuation) COMPREPLY=($(compgen -W 'load arclength' -- "$word"));;
    -bifurcation) COMPREPLY=($(compgen -W 'off locate stop switch' -- "$word"));;
    -model) COMPREPLY=($(compgen -W 'full torsion_free planar cable auto' -- "$word"));;
    -stretch) COMPREPLY=($(compgen -W 'primal mixed' -- "$word"));;
    -retraction) COMPREPLY=($(compgen -W 'additive length' -- "$word"));;
    -hessian) COMPREPLY=($(compgen -W 'exact gauss_newton' -- "$word"));;
    -line_search) COMPREPLY=($(compgen -W 'energy wolfe residual' -- "$word"));;
    -partition) COMPREPLY=($(compgen -W 'auto contiguous metis' -- "$word"));;
    -accuracy_of) COMPREPLY=($(compgen -W 'position tip energy' -- "$word"));;
    -rod_measure) COMPREPLY=($(compgen -W 'tan angle' -- "$word"));;
    -rod_energy) COMPREPLY=($(compgen -W 'seed classical' -- "$word"));;
    -scene|-restart|-output_dir|-output_shapes|-options_file) COMPREPLY=($(compgen -f -- "$word"));;
    *) COMPREPLY=($(compgen -W '-scene -gravity -restart -restart_time -schema -keys -mode -modes -buckling_to -dt -t_end -time_limit -integrator -rho_inf -dt_adapt -dt_rtol -dt_atol -dt_max -dt_min -load_steps -continuation -arclength_steps -bifurcation -snes_rtol -snes_max_it -rounding_tolerance -model -model_check -stretch -retraction -hessian -line_search -partition -quasi_newton -rod_edges -contact_stiffness -contact_distance -contact_friction -error_estimate -accuracy -accuracy_of -output_dir -output_shapes -output_interval -checkpoint_interval -output_fields -rod_measure -rod_energy -rod_radius -rod_radii -rod_width -rod_height -rod_young -rod_poisson -rod_shear -rod_density -rod_linear_density -rod_linear_rotational_inertia -rod_axial_stiffness -rod_torsional_stiffness -rod_flexural_stiffness -rod_mass_damping_coefficient -rod_stiffness_damping_coefficient -help' -- "$word"));;
  esac
}
complete -o filenames -F _tendril tendril build/bin/tendril
