cd /work/tmp/h/scale
until grep -q "before finish" big5000.log; do sleep 3; done
kill $(pgrep -f "prof.py 5000 3 big" | tail -1)
cd run2; export PYTHONPATH=$PWD OMP_NUM_THREADS=1
nice -n 10 python ../fin.py ../out_big_5000 5000 big > ../fin5000.log 2>&1
