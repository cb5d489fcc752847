# An image of Colibri: docker build -t colibri . && docker run --rm colibri fly spiral --out /tmp/spiral
FROM python:3.12-slim AS build
WORKDIR /src
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
RUN useradd --create-home --uid 1000 pilot
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl
USER 1000
WORKDIR /home/pilot
RUN colibri compile --quiet
ENTRYPOINT ["colibri"]
CMD ["sitl"]
