# For other scripts: one job run part by part, and the parts' tables joined to one. Sourced in the repository's root with
#   job      name of the job; part A,B leaves out/JOB_A_B, which keeps what is done
#   labels   names of the table's first columns, one for each A,B
#   columns  variables of the others
# Needs the environment of jobs/quickstart.sh.
PATH=$PWD/.venv/bin:$PATH
table=jobs/results/$job.csv
rm -f "$table.part" "$table.origin"

part() { # VALUES-OF-LABELS SETTINGS...
  local values=$1
  local name=${job}_${values//,/_}
  shift
  cvt-hpc run "jobs/$job.toml" --set name="$name" "$@" > /dev/null
  python jobs/tabulate.py "out/$name" "out/$name/table.csv" "${columns[@]}" > /dev/null
  grep '^#' "out/$name/table.csv" >> "$table.origin"
  [ -s "$table.part" ] || sed "/^#/d; s/^/$labels,/; q" "out/$name/table.csv" > "$table.part"
  sed "/^#/d" "out/$name/table.csv" | sed "1d; s/^/$values,/" >> "$table.part"
}

joined() { # all parts are done; of their origins each line once, but the machine's speed, which differs a little
  awk '!seen[$0]++ && !(/^# machine: .* take / && machine++)' "$table.origin" > "$table.whole"
  cat "$table.part" >> "$table.whole"
  mv "$table.whole" "$table"
  rm "$table.part" "$table.origin"
}
